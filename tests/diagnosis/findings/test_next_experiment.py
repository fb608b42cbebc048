"""The recording that would split causes, for an arm whose trajectories cannot be simulated."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from samrl_core.diagnosis.effects import find_family
from samrl_core.diagnosis.findings import next_experiment as proposals
from samrl_core.diagnosis.findings.next_experiment import next_experiment
from samrl_core.diagnosis.kinds.arms import arm_trials
from tests.diagnosis import worlds


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
    found = next_experiment(likelihood, fits, names, 0)
    assert found is not None and found.programme["kind"] == kind and found.programme["joints"] == ["lift"]
    assert "chosen by rule" in found.why


def test_one_fit_alone_is_not_said_to_differ_by_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """A rival without a fit of its own leaves nothing to simulate: the rule, and no discrimination of 0."""
    monkeypatch.setattr(proposals, "robot_with_joints", lambda joints: object())
    monkeypatch.setattr(proposals, "file_runs", lambda *_: [object()])
    monkeypatch.setattr(proposals, "_virtual", lambda trial, run: trial)
    monkeypatch.setattr(proposals, "discrimination", lambda virtual, rivals: 0.0)  # as of one alone
    trials, _ = arm_trials(worlds.world(1, "A"), [])
    likelihood: Any = SimpleNamespace(trials=trials)
    named = SimpleNamespace(name="payload@tool", place="tool", effect=find_family("payload"))
    fits: list[Any] = [SimpleNamespace(hypotheses=(named,), amplitudes=(np.ones(4),))]
    found = next_experiment(likelihood, fits, ["payload@tool", "cable@joint:panda_joint4"], 0)
    assert found is not None and "chosen by rule" in found.why and found.separates == 0.5
