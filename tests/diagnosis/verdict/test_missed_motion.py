"""A name must do to the motion what it would do, were it all there is: an arm with a load, and a wrong model.

The arm's links have no inertia about their centres, as in an engine that was given none; the URDF states it.
Ten free numbers at the flange take that into the load: 0.30 kg for 0.50, with more evidence than the load.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest

from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose, library
from samrl_core.diagnosis.kinds.arms import arm_trials
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.result import HeldOutGap, NamedEffect
from samrl_core.diagnosis.selection import selection as selecting
from samrl_core.diagnosis.selection.contenders import Contender
from samrl_core.diagnosis.selection.form_that_moves import with_form_that_moves
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from samrl_core.diagnosis.verdict.foretold_motion import ForetoldMotion, foretell_motion
from samrl_core.diagnosis.verdict.how_far import HowFar
from samrl_core.diagnosis.verdict.rules import VerdictSettings, decide
from tests.diagnosis.verdict.test_foretelling import chosen_from

if TYPE_CHECKING:
    from samrl_core.diagnosis.residuals.observed import Observed

LENGTHS, MASSES, LOAD = (0.4, 0.35), (3.0, 2.0), 0.5  # [m], [kg]
LIBRARY = ("payload", "link_inertia", "actuator_gain", "viscous_friction")


def urdf(load: float = 0.0, inertia: float = 1.0) -> str:
    """Two rods in a vertical plane, with this share of their inertia, and a load at the end."""
    parts = ['<link name="base"/>']
    for k, (length, mass) in enumerate(zip(LENGTHS, MASSES, strict=True)):
        about = max(inertia, 1e-3) * mass * length**2 / 12.0
        parts.append(
            f'<link name="link{k}"><inertial><origin xyz="{length / 2} 0 0"/><mass value="{mass}"/>'
            f'<inertia ixx="{about / 10}" iyy="{about}" izz="{about}" ixy="0" ixz="0" iyz="0"/></inertial>'
            "</link>"
        )
    for k, (parent, at) in enumerate((("base", 0.0), ("link0", LENGTHS[0]))):
        parts.append(
            f'<joint name="joint{k}" type="revolute"><parent link="{parent}"/><child link="link{k}"/>'
            f'<origin xyz="{at} 0 0"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="60" velocity="4"'
            "/></joint>"
        )
    if load:
        parts.append(
            f'<link name="load"><inertial><mass value="{load}"/><inertia ixx="1e-6" iyy="1e-6" izz="1e-6"'
            ' ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="screw" type="fixed">'
            f'<parent link="link1"/><child link="load"/><origin xyz="{LENGTHS[1]} 0 0"/></joint>'
        )
    return f'<robot name="two">{"".join(parts)}</robot>'


def recording(seed: int) -> ArmRecording:
    """Positions and torques of the loaded arm under a sum of sines, and the description without the load."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, 12.0, 0.004)
    turn = 2.0 * np.pi * np.array([0.1, 0.23, 0.41, 0.7])[:, None]
    size, phase = rng.uniform(0.1, 0.4, (2, 4, 1)), rng.uniform(0.0, 6.28, (2, 4, 1))
    q = np.sum(size * np.sin(turn * time + phase), axis=1).T
    dq = np.sum(size * turn * np.cos(turn * time + phase), axis=1).T
    ddq = -np.sum(size * turn**2 * np.sin(turn * time + phase), axis=1).T
    names = ("joint0", "joint1")
    true = RigidArm(ArmDescription("tool_arm", names, urdf(LOAD, 0.0), None))
    effort = true.inverse_dynamics(q, dq, ddq) + 0.05 * rng.standard_normal(q.shape)
    states = JointSignal(time, q + 2e-5 * rng.standard_normal(q.shape))
    about = ArmDescription("tool_arm", names, urdf(), None)
    return ArmRecording(f"run{seed}", f"{seed}", "", about, states, None, JointSignal(time, effort=effort))


@pytest.fixture(scope="module")
def recordings() -> list[ArmRecording]:
    return [recording(seed) for seed in (1, 2)]


@pytest.fixture(scope="module")
def freely(recordings: list[ArmRecording]) -> tuple[Evidence, list, Fit, Observed]:
    """Evidence, payloads, the one of ten free numbers, and the recording that is held out."""
    fitted, held = arm_trials(recordings[:1], recordings[1:])
    evidence = Evidence(Likelihood(fitted), 15.0)
    pool = evidence.screen(library(["payload"]))
    return evidence, pool, evidence.fit([h for h in pool if len(h.mean) == 10]), held[0]


def mass(fit: Fit, trial: Observed) -> float:
    h = fit.hypotheses[0]
    return h.form.parameters(trial, h.shape, fit.amplitudes[0])["mass"]


@pytest.mark.thorough
def test_the_form_is_taken_that_moves_as_was_recorded(
    freely: tuple[Evidence, list, Fit, Observed],
) -> None:
    evidence, pool, free, held = freely
    assert mass(free, held) < 0.7 * LOAD
    (found,) = with_form_that_moves(evidence, pool, [Contender(free, 0.02)], free.log_evidence)
    assert found.fit.log_evidence < free.log_evidence
    assert mass(found.fit, held) == pytest.approx(LOAD, rel=0.15)


@pytest.mark.thorough
def test_what_is_below_tolerances_foretells_no_shrink(freely: tuple[Evidence, list, Fit, Observed]) -> None:
    """A load of 1 g changes nothing that tolerances do not change more; one of 315 g would be seen."""
    _, _, free, held = freely
    small = replace(free, amplitudes=tuple(a / 300.0 for a in free.amplitudes))
    found = [foretell_motion([held], fit, np.random.default_rng(0)) for fit in (small, free)]
    assert [f is not None and f.tells(0.3) for f in found] == [False, True]


@pytest.mark.thorough
def test_a_load_is_found_at_the_size_that_moves(recordings: list[ArmRecording]) -> None:
    """It was 0.33 kg for certain, in [0.26, 0.41], and the held-out gap shrank by 9 %."""
    found, _ = diagnose(recordings[:1], recordings[1:], DiagnosisSettings(library=LIBRARY))
    first = found.effects[0] if found.effects else found.nearest
    assert first is not None
    assert first.family == "payload"
    low, high = first.parameters["mass"].ci95
    assert low < LOAD < high
    assert found.gap is not None
    assert found.gap.shrink is not None
    assert found.gap.shrink > 0.5


@pytest.mark.thorough
def test_a_size_that_does_not_move_is_not_certain(
    recordings: list[ArmRecording], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Were there no other form: its evidence is 600, and the motion denies it."""
    monkeypatch.setattr(
        selecting, "with_form_that_moves", lambda _evidence, _pool, contenders, _excess: contenders
    )
    found, _ = diagnose(recordings[:1], recordings[1:], DiagnosisSettings(library=LIBRARY))
    assert found.verdict in ("ambiguous", "none_of_mine")
    assert any(reason.startswith("were payload@arm:tool_arm all there is") for reason in found.reasons)
    assert all(e.probability < 0.6 for e in found.effects)


NAME = NamedEffect("payload", "arm:tool_arm", 1.0, {}, 586.0, "", "primary")
RIVAL = replace(NAME, family="link_inertia", place="link:link1", gain=376.0, role="runner_up")


@pytest.mark.parametrize(
    ("foretold", "probability", "verdict", "says"),
    [
        (ForetoldMotion((0.3, 0.8, 0.9), 2.0), 1.0, "none_of_mine", "all there is, the gap"),
        (ForetoldMotion((0.3, 0.8, 0.9), 2.0), 0.4, "ambiguous", "all there is, the gap"),
        (ForetoldMotion((-0.01, 0.05, 0.12), 17.0), 1.0, "effect", "says nothing of it"),
        (ForetoldMotion((-0.2, 0.5, 0.9), 6.0), 1.0, "effect", "does not shrink"),
    ],
    ids=["missed", "missed, with a rival", "motion cannot tell", "within what is foretold"],
)
def test_a_gap_that_does_not_shrink_is_held_against_what_it_would(
    foretold: ForetoldMotion, probability: float, verdict: str, says: str
) -> None:
    gap = HeldOutGap("", "1", 10.8, 10.9, 9.8, RIVAL.name, -0.004, (-0.25, 0.23), -0.1)
    effect = SimpleNamespace(by_chance=False, limits_motion=False, confounded_with=())
    fit = cast("Fit", SimpleNamespace(hypotheses=[SimpleNamespace(effect=effect)], log_evidence=586.0))
    selection = chosen_from([fit])
    named, rival = replace(NAME, probability=probability), replace(RIVAL, probability=1.0 - probability)
    far = HowFar(gap, (), motion=0.0, foretold=foretold)
    outcome = decide(selection, [named], [rival], [], far, VerdictSettings())
    assert outcome.verdict == verdict
    assert any(says in reason for reason in outcome.reasons)


def test_what_is_left_counts_beyond_what_would_be_left() -> None:
    foretold = ForetoldMotion((0.3, 0.8, 0.9), 6.0)
    gap = HeldOutGap("", "1", 10.0, 8.0, None, None, 0.2, (-0.1, 0.3), None)
    assert foretold.beyond(gap) == pytest.approx((64.0 - 36.0) / (100.0 - 36.0))
    assert not foretold.is_missed(replace(gap, shrink=0.31), 0.3)
    assert foretold.is_missed(gap, 0.3)
