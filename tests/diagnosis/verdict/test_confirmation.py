"""What no held-out recording could show is no certain name."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest

from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.diagnose import diagnose
from samrl_core.diagnosis.recordings.held_out import split
from samrl_core.diagnosis.result import HeldOutGap
from samrl_core.diagnosis.selection.hypothesis import Fit
from samrl_core.diagnosis.verdict.confirmation import nothing_confirms
from samrl_core.diagnosis.verdict.decision import VerdictSettings
from samrl_core.diagnosis.verdict.how_far import HowFar
from tests.diagnosis.verdict.test_foretelling import chosen_from

if TYPE_CHECKING:
    from samrl_core.diagnosis.residuals.likelihood import Likelihood

RATE_HZ, SECONDS, STEP_S, NOISE_RAD, CORNER_RAD_S = 200.0, 3.0, 0.25, 2e-3, 4.0


def servo(second_step_s: float | None) -> ArmRecording:
    """A motor that follows a step of its goal like a filter, and goes back with a second one."""
    time = np.arange(0.0, SECONDS, 1.0 / RATE_HZ)
    goal = np.where(time < STEP_S, 0.0, 1.5)
    if second_step_s is not None:
        goal[time >= second_step_s] = 0.0
    position, share = np.zeros(len(time)), 1.0 - np.exp(-CORNER_RAD_S / RATE_HZ)
    for k in range(1, len(time)):
        position[k] = position[k - 1] + share * (goal[k - 1] - position[k - 1])
    position += NOISE_RAD * np.random.default_rng(0).standard_normal(len(time))
    arm = ArmDescription("tool_arm", ("motor",), None, None)
    states = JointSignal(time, position[:, None], np.gradient(position, time)[:, None])
    return ArmRecording("step", "step.csv", "", arm, states, JointSignal(time, goal[:, None]), None)


@pytest.mark.parametrize(
    ("second_step_s", "verdict"), [(None, "ambiguous"), (2.2, "effect")], ids=["one step", "two"]
)
def test_a_step_that_is_over_where_the_cut_is_names_nothing_for_sure(
    second_step_s: float | None, verdict: str
) -> None:
    """A motor's PID step, alone, was a low-pass at > 99 % though its held-out gap shrank by 0 %."""
    fit, held_out = split(servo(second_step_s))
    found, _ = diagnose([fit], [held_out])
    assert found.verdict == verdict, found.reasons
    (first,) = found.effects
    assert first.family == "command_low_pass"
    if verdict == "effect":
        assert first.parameters["fc"].value == pytest.approx(CORNER_RAD_S / (2.0 * np.pi), rel=0.1)
        return
    assert first.probability <= 0.5 and found.ambiguity_set[0][0] == first.name
    assert "held-out recordings lack the motion" in found.reasons[0] and "twice" in found.reasons[1]


@pytest.mark.parametrize(
    ("changes", "open_"),
    [
        ({}, True),
        ({"expected": 20.0}, False),  # of 900 on the fitted ones: it would show
        ({"shrink": 0.2}, False),  # it does show, in motion
        ({"shrink": None}, False),  # nothing is held out
        ({"by_chance": True}, False),  # need not strike again
        ({"second": 1.0}, False),  # a second recording, or
        ({"second": -1.0, "blocks": 1}, False),  # the way back, confirms the first event
        ({"second": 1.0, "blocks": 1}, True),
        ({"second": -0.1}, True),
        ({"rival": 800.0}, False),  # a rival that they refute
        ({"rival": 100.0}, True),  # whom the fitted recordings do already
    ],
    ids=[
        "nothing",
        "residual",
        "motion",
        "none held out",
        "chance",
        "two recordings",
        "back again",
        "one event",
        "hardly two",
        "refuted rival",
        "far rival",
    ],
)
def test_what_could_show_somewhere_is_confirmed_or_denied_there(changes: dict, open_: bool) -> None:
    given = {"expected": 0.5, "shrink": 0.0, "by_chance": False, "second": 0.0, "blocks": 2, "rival": 0.0}
    given |= changes
    effect = SimpleNamespace(by_chance=given["by_chance"])
    law = cast("Any", SimpleNamespace(effect=effect, regressors=None))
    one = Fit((law,), (np.ones(1),), np.eye(1), 900.0)
    shown = np.repeat([4.0, 4.0 * given["second"]], 200)
    size = 400 // given["blocks"]  # samples of each recording
    fitted = SimpleNamespace(
        y=np.zeros(400), trials=(None, None), tolerated=lambda y, k: 0.0 * y,
        prediction=lambda regressors, amplitudes: shown,
        blocks={(r, "tracking", 0): slice(size * r, size * (r + 1)) for r in range(given["blocks"])},
    )  # fmt: skip
    other = replace(one, hypotheses=(cast("Any", SimpleNamespace(name="b")),), log_evidence=given["rival"])
    gap = HeldOutGap("", "1", 0.3, 0.3, 0.6, "b", given["shrink"], (0.0, 0.0), 1.0, (), ())
    selection = replace(chosen_from([one]), rivals=(other,), held_out_expected=given["expected"])
    found = nothing_confirms(cast("Likelihood", fitted), selection, HowFar(gap, ()), VerdictSettings())
    assert found is open_
