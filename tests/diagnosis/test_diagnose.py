"""From recordings to a verdict: nothing where nothing is, else the cause, its place and its size."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.result import Diagnosis, ParameterEstimate
from samrl_core.diagnosis.verdict import rules
from tests.diagnosis import worlds
from tests.diagnosis.cases import PAYLOAD
from tests.diagnosis.worlds import BEND, LIFT, TURN

FRICTIONS = {"coulomb_friction", "viscous_friction"}
LOADS = {"payload", "link_inertia", "base_tilt", "actuator_gain", "torque_sensor_error"}
TIMING = {"command_delay", "command_low_pass", "controller_gain"}


def full(*values: Any) -> Any:
    """Test parameters with the whole library, which takes longer."""
    return pytest.param(*values, None, marks=pytest.mark.slow)


def diagnosed(seed: int, library: set[str] | None = None, **fields: Any) -> Diagnosis:
    """Fitted on A and B, held out C at other gains."""
    a, b, c = worlds.world(seed, **fields)
    diagnosis, _ = diagnose([a, b], [c], DiagnosisSettings(library=library))
    return diagnosis


def assert_covers(estimate: ParameterEstimate, truth: float, share: float = 0.1) -> None:
    """The interval holds the truth, and the value is near it, so that a wide interval is no excuse."""
    low, high = estimate.ci95
    assert low <= truth <= high, f"{truth} outside of {estimate.ci95}"
    assert estimate.value == pytest.approx(truth, rel=share)


@pytest.mark.parametrize(
    "seed", [1, pytest.param(2, marks=pytest.mark.slow), pytest.param(3, marks=pytest.mark.slow)]
)
def test_a_nominal_arm_has_no_gap(seed: int) -> None:
    diagnosis = diagnosed(seed)
    assert diagnosis.verdict == "no_gap", diagnosis.reasons
    assert not diagnosis.effects and not diagnosis.where and not diagnosis.ambiguity_set
    assert [i.role for i in diagnosis.inputs] == ["fit", "fit", "held_out"]


def test_a_gap_that_only_held_out_recordings_show_is_fitted_on_their_first_half() -> None:
    """The task-like motion stays below a drive's limit that the held-out chirp exceeds throughout."""
    _, b, c = worlds.world(4, effort_limit={LIFT: 9.0})
    settings = DiagnosisSettings(library={"torque_saturation", "coulomb_friction", "actuator_gain"})
    diagnosis, _ = diagnose([c], [b], settings)
    assert [e.name for e in diagnosis.effects] == ["torque_saturation@joint:lift"], diagnosis.reasons
    assert [i.role for i in diagnosis.inputs] == ["fit", "fit", "held_out"]
    assert any("first halves" in note for note in diagnosis.notes)

    # What the user holds out is never fitted: then the contradiction is said.
    kept, _ = diagnose([c], [b], replace(settings, share_held_out=False))
    assert kept.verdict == "none_of_mine" and "held-out recordings hold" in kept.reasons[0]
    assert [i.role for i in kept.inputs] == ["fit", "held_out"]


def test_held_out_recordings_that_are_too_short_to_be_halved_end_no_diagnosis(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(rules, "only_held_out", lambda *_: True)
    (a,), (b,) = (worlds.record(worlds.plant(), name, None, 1.8) for name in "AB")
    settings = DiagnosisSettings(library={"viscous_friction"}, simulate=False)
    diagnosis, _ = diagnose([a], [b], settings)
    assert diagnosis.verdict == "none_of_mine"
    assert [i.role for i in diagnosis.inputs] == ["fit", "held_out"]
    assert any("cannot be halved: a gap of 0.5 s" in note for note in diagnosis.notes)


def test_what_nothing_known_can_be_is_not_named() -> None:
    """A sensor that reads a tenth is dead, not off by a gain: no catalogue knows such an error."""
    diagnosis = diagnosed(9, {"actuator_gain", "torque_sensor_error"}, sensor_gain={LIFT: -0.9})
    assert diagnosis.verdict == "none_of_mine"
    named = [diagnosis.nearest, *diagnosis.runner_ups]
    for effect in named:
        if effect is not None:
            assert all(abs(p.value) < 0.35 for p in effect.parameters.values() if p.unit == "1")


@pytest.mark.parametrize("joint, seed", [("lift", 5), pytest.param("turn", 6, marks=pytest.mark.slow)])
def test_coulomb_friction_is_named_with_its_place_and_level(joint: str, seed: int) -> None:
    diagnosis = diagnosed(seed, coulomb={worlds.JOINTS.index(joint): 0.8})
    assert diagnosis.verdict == "effect", diagnosis.reasons
    (effect,) = diagnosis.effects
    assert effect.name == f"coulomb_friction@joint:{joint}"
    # what the arm may have within its tolerances is part of the level, up to 0.03 N m here
    assert_covers(effect.parameters["Fc"], 0.8 + 0.014)
    assert diagnosis.gap is not None and diagnosis.gap.shrink is not None and diagnosis.gap.shrink > 0.6
    assert diagnosis.curves and diagnosis.overlays and diagnosis.heatmap is not None


@pytest.mark.parametrize("field, value", [("viscous", 1.0), ("coulomb", 0.8)])
def test_a_named_effect_says_where_the_gap_is(field: str, value: float) -> None:
    diagnosis = diagnosed(5, FRICTIONS, **{field: {LIFT: value}})
    assert diagnosis.verdict == "effect"
    assert {w.place for w in diagnosis.where} == {"joint:lift"}
    assert {w.channel for w in diagnosis.where} == {"drive"}
    assert sum(w.share for w in diagnosis.where) == pytest.approx(1.0, abs=0.05)
    assert all(0 <= w.t0 <= w.t1 <= worlds.DURATION_S for w in diagnosis.where)


@pytest.mark.parametrize("seed, library", [(5, LOADS), full(6)])
def test_a_payload_is_named_with_its_mass_and_centre(seed: int, library: set[str] | None) -> None:
    diagnosis = diagnosed(seed, library, payload=PAYLOAD)
    assert diagnosis.verdict == "effect", diagnosis.reasons
    (effect,) = diagnosis.effects
    assert effect.name == "payload@arm:tool_arm"
    assert_covers(effect.parameters["mass"], PAYLOAD[0])
    for name, truth in zip(("com_x", "com_y", "com_z"), PAYLOAD[1:4] / PAYLOAD[0], strict=True):
        low, high = effect.parameters[name].ci95
        assert low - 0.005 < truth < high + 0.005
    assert diagnosis.gap is not None and diagnosis.gap.shrink is not None and diagnosis.gap.shrink > 0.8


@pytest.mark.parametrize("seed, library", [(5, TIMING), full(6)])
def test_a_command_delay_is_named_or_tied_with_its_twin(seed: int, library: set[str] | None) -> None:
    """A delay of a few milliseconds and a low-pass of the same lag are alike below 4 Hz."""
    diagnosis = diagnosed(seed, library, command_delay=0.009)
    assert diagnosis.verdict in ("effect", "ambiguous"), diagnosis.reasons
    effect = diagnosis.effects[0]
    assert effect.name == "command_delay@arm:tool_arm"
    assert_covers(effect.parameters["T"], 0.009)
    if diagnosis.verdict == "ambiguous":
        assert set(diagnosis.ambiguity_set[0]) <= {effect.name, "command_low_pass@arm:tool_arm"}


@pytest.mark.slow
def test_a_torque_sensor_bias_is_named() -> None:
    diagnosis = diagnosed(5, sensor_bias={BEND: 0.9})
    assert diagnosis.verdict == "effect", diagnosis.reasons
    (effect,) = diagnosis.effects
    assert effect.name == "torque_sensor_error@joint:bend"
    assert_covers(effect.parameters["b"], 0.9)
    low, high = effect.parameters["g"].ci95
    assert low < 0.005 and high > -0.005


@pytest.mark.slow
def test_two_effects_on_two_joints_are_both_named() -> None:
    diagnosis = diagnosed(5, viscous={TURN: 1.0}, actuator_gain={LIFT: 0.15})
    assert diagnosis.verdict == "effect", diagnosis.reasons
    found = {e.name: e.parameters for e in diagnosis.effects}
    assert set(found) == {"viscous_friction@joint:turn", "actuator_gain@joint:lift"}
    assert_covers(found["viscous_friction@joint:turn"]["Fv"], 1.0)
    assert_covers(found["actuator_gain@joint:lift"]["e"], 0.15)
    assert {e.role for e in diagnosis.effects} == {"primary", "secondary"}


@pytest.mark.slow
def test_friction_and_a_biased_sensor_are_both_named() -> None:
    diagnosis = diagnosed(5, coulomb={LIFT: 0.8}, sensor_bias={TURN: 1.6})
    assert diagnosis.verdict == "effect", diagnosis.reasons
    assert {e.name for e in diagnosis.effects} == {
        "coulomb_friction@joint:lift",
        "torque_sensor_error@joint:turn",
    }


def test_the_same_seed_gives_the_same_answer() -> None:
    first, second = (diagnosed(7, {"viscous_friction"}, viscous={LIFT: 1.0}) for _ in range(2))
    assert first.effects == second.effects and first.gap == second.gap and first.reasons == second.reasons
    assert first.effects[0].name == "viscous_friction@joint:lift"


def test_without_held_out_recordings_nothing_is_said_of_shrink() -> None:
    a, b, _ = worlds.world(8, coulomb={LIFT: 0.8})
    diagnosis, far = diagnose([a, b], [], DiagnosisSettings(library={"coulomb_friction", "payload"}))
    assert diagnosis.gap is None and far.gap is None and not diagnosis.overlays
    assert diagnosis.effects[0].name == "coulomb_friction@joint:lift"


@pytest.mark.thorough
def test_why_an_effect_is_not_tracked_is_told() -> None:
    """A misspelt place left `tracked` empty, and nobody said why; so did a size that may not be."""
    a, b, _ = worlds.world(8, viscous={LIFT: 1.0})
    asked = ("viscous_friction@joint:turn", "viscous_friction@joint:lifd")
    settings = DiagnosisSettings(library={"viscous_friction"}, track=asked, simulate=False)
    diagnosis, _ = diagnose([a, b], [], settings)
    none_there, misspelt = diagnosis.notes[-2:]
    assert none_there.startswith(f"{asked[0]} is not tracked: no size that viscous_friction may have fits")
    assert misspelt.startswith(f"{asked[1]} is not tracked: these recordings show viscous_friction at ")
    assert "joint:lift" in misspelt and not diagnosis.tracked


def test_without_recordings_nothing_is_diagnosed() -> None:
    with pytest.raises(InputError, match="no recording to fit"):
        diagnose([], [])


@pytest.mark.parametrize("lacking", ["command", "commanded_effort", "effort"])
@pytest.mark.parametrize("which", [0, 1, 2])
def test_what_one_recording_lacks_is_used_in_none(lacking: str, which: int) -> None:
    recordings = worlds.record(worlds.plant(), "ABC", np.random.default_rng(0), 4.0)
    recordings[which] = without(recordings[which], lacking)
    a, b, c = recordings
    library = {"torque_saturation", "command_delay", "actuator_gain"}
    diagnosis, _ = diagnose([a, b], [c], DiagnosisSettings(library=library))
    assert diagnosis.verdict in ("no_gap", "not_testable"), diagnosis.reasons
    assert any(recordings[which].name in n and "is not used" in n for n in diagnosis.notes), diagnosis.notes


def without(recording: ArmRecording, lacking: str) -> ArmRecording:
    if lacking == "effort":
        return replace(recording, states=replace(recording.states, effort=None))
    return replace(recording, **{lacking: None})


def test_torques_without_a_description_ask_for_the_urdf() -> None:
    recordings = worlds.record(worlds.plant(), "AC", np.random.default_rng(0), 2.0)
    bare = [replace(r, arm=replace(r.arm, urdf=None, controller=None), command=None) for r in recordings]
    diagnosis, _ = diagnose(bare[:1], bare[1:])
    assert diagnosis.verdict == "not_testable" and "--urdf FILE" in diagnosis.reasons[0]


@pytest.mark.parametrize("urdf", [worlds.URDF, None])
def test_positions_alone_are_not_testable(urdf: str | None) -> None:
    recordings = worlds.record(worlds.plant(), "ABC", duration_s=3.0)
    bare = [
        replace(
            r,
            arm=replace(r.arm, urdf=urdf, controller=None),
            states=replace(r.states, velocity=None, effort=None),
            command=None,
            commanded_effort=None,
        )
        for r in recordings
    ]
    for held_out in (bare[2:], []):
        diagnosis, far = diagnose(bare[:2], held_out)
        assert diagnosis.verdict == "not_testable" and "neither efforts nor" in diagnosis.reasons[0]
        assert far.gap is None and not diagnosis.effects


def test_a_description_that_only_some_have_is_asked_for() -> None:
    a, b = worlds.record(worlds.plant(), "AB", duration_s=3.0)
    with pytest.raises(InputError, match="B carries no URDF.*--urdf"):
        diagnose([a, replace(b, arm=replace(b.arm, urdf=None))], [])
    with pytest.raises(InputError, match="B carries no description of the controller"):
        diagnose([a], [replace(b, arm=replace(b.arm, controller=None))])


def test_two_arms_are_not_mixed() -> None:
    (a,) = worlds.world(9, "A")
    other = replace(a, arm=replace(a.arm, joints=("x", "y", "z")))
    with pytest.raises(InputError, match="one arm at a time"):
        diagnose([a], [other])


def test_every_simulated_channel_is_free_of_gap_without_noise_or_background() -> None:
    """The nominal arm's residuals stay far below what the tolerances allow."""
    for trial in worlds.trials(worlds.record(worlds.plant(), "ABC")):
        assert trial.channels == ("controller", "drive", "link")
        for channel in trial.channels:
            rms = np.sqrt(np.mean(trial.equations.residual[channel] ** 2, axis=0))
            assert (rms < 0.004 * np.array([40.0, 40.0, 20.0])).all(), f"{channel}: {rms}"
