"""The recording that would split causes, for an arm whose trajectories cannot be simulated."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from samrl_core.cell.excitation.runs import Run
from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.diagnosis.effects import find_family
from samrl_core.diagnosis.findings import next_experiment as proposals
from samrl_core.diagnosis.findings.discrimination import separation
from samrl_core.diagnosis.findings.next_experiment import next_experiment
from samrl_core.diagnosis.kinds.arms import arm_trials
from samrl_core.diagnosis.verdict.confidence import TEMPERATURE
from samrl_core.diagnosis.verdict.rules import VerdictSettings
from tests.diagnosis import worlds


def every(signal: JointSignal, step: int) -> JointSignal:
    parts = {q: getattr(signal, q) for q in ("position", "velocity", "effort")}
    return JointSignal(signal.time[::step], **{q: None if x is None else x[::step] for q, x in parts.items()})


def with_acceleration(command: JointSignal) -> JointSignal:
    assert command.velocity is not None
    return replace(command, acceleration=np.gradient(command.velocity, command.time, axis=0))


@pytest.mark.parametrize(
    ("families", "kind"),
    [
        (("cable", "payload"), "sweep"),
        (("payload", "cable"), "static"),  # of as many, that of the first name, whatever a set's order is
        (("cable", "payload", "base_tilt"), "static"),
    ],
)
def test_an_arm_of_others_gets_what_most_causes_have_in_common(families: tuple[str, ...], kind: str) -> None:
    trials, _ = arm_trials(worlds.world(1, "A"), [])
    likelihood: Any = SimpleNamespace(trials=trials)
    names = [f"{family}@joint:lift" for family in families]
    fits: list[Any] = [
        SimpleNamespace(
            hypotheses=(SimpleNamespace(name=name, place="joint:lift", effect=find_family(family)),),
            amplitudes=(np.ones(1),),
        )
        for name, family in zip(names, families, strict=True)
    ]
    found, _ = next_experiment(likelihood, fits, names, 0)
    assert found is not None and found.programme["kind"] == kind and found.programme["joints"] == ["lift"]
    assert "chosen by rule" in found.why


def test_one_fit_alone_is_not_said_to_differ_by_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """A rival without a fit of its own leaves nothing to simulate: the rule, and no discrimination of 0."""
    monkeypatch.setattr(proposals, "robot_with_joints", lambda joints: object())
    monkeypatch.setattr(proposals, "file_runs", lambda *_: [object()])
    monkeypatch.setattr(proposals, "_virtual", lambda trial, run, seed: trial)
    monkeypatch.setattr(proposals, "discrimination", lambda virtual, rivals: 0.0)  # as of one alone
    trials, _ = arm_trials(worlds.world(1, "A"), [])
    likelihood: Any = SimpleNamespace(trials=trials)
    named = SimpleNamespace(name="payload@tool", place="tool", effect=find_family("payload"))
    fits: list[Any] = [SimpleNamespace(hypotheses=(named,), amplitudes=(np.ones(4),))]
    found, _ = next_experiment(likelihood, fits, ["payload@tool", "cable@joint:panda_joint4"], 0)
    assert found is not None and "chosen by rule" in found.why and found.separates == 0.5


def test_probability_of_a_split_is_that_of_the_likelihood_ratio() -> None:
    """Hypotheses whose predictions differ by an energy of 2 K are told apart as often as noise lets them."""
    rng = np.random.default_rng(5)
    settings = VerdictSettings()
    for k in (1.0, 3.0, 8.0):
        difference = np.full(50, np.sqrt(2.0 * k / 50))
        seen = difference + rng.standard_normal((20000, 50))
        ratio = 0.5 * np.sum(seen**2 - (seen - difference) ** 2, axis=1)
        wrong = 1.0 / (1.0 + np.exp(ratio / TEMPERATURE))
        assert separation(k) == pytest.approx(float(np.mean(wrong < settings.rival)), abs=0.015)
    assert separation(0.0) == 0.0


@pytest.mark.parametrize("lacks", ["velocity", "effort", "commanded_effort"])
def test_a_simulated_log_holds_what_the_real_one_does(lacks: str) -> None:
    """With a speed or a torque that nobody logs, anything would be told apart."""
    (recording,) = worlds.world(1, "A")
    states = recording.states
    if lacks == "commanded_effort":
        recording = replace(recording, commanded_effort=None)
    else:
        recording = replace(recording, states=replace(states, **{lacks: None}))
    slow = 4
    recording = replace(recording, states=every(recording.states, slow))
    (trial,) = worlds.trials([recording])
    run = Run("next", with_acceleration(worlds.commanded("B", 3.0)), worlds.arm().controller)
    made = proposals._virtual(trial, run, 0)
    assert made.motion.rate == pytest.approx(trial.motion.rate, rel=0.01)
    if lacks == "commanded_effort":  # the law stands for it, and is known
        assert trial.channels == ("drive", "link") and made.channels == ("controller", "drive", "link")
    else:
        assert made.channels == tuple(
            c for c in trial.channels if c != "controller" or "controller" in made.channels
        )
    assert (made.motion.raw_velocity is None) == (trial.motion.raw_velocity is None)
    assert (made.motion.tau is None) == (trial.motion.tau is None)
