"""What a recording is said to lack to show what a controller does: not what it has."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest

from samrl_core.cell.types.arm_description import ArmController
from samrl_core.cell.types.controllers.motors import CurrentMotor
from samrl_core.diagnosis.effects import find_family
from samrl_core.diagnosis.effects.effect import Effect
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from tests.diagnosis.controllers.late_speeds import JOINT, PERIOD_S, ROTOR
from tests.diagnosis.controllers.test_fed_speed import without_speed

FAMILIES = ("command_low_pass", "command_delay", "packet_jitter", "controller_gain", "dead_band")


def motor() -> ArmController:
    """A drive that is told its current."""
    about = {
        "type": "current_motor", "joints": [JOINT], "torque_constant": [1.0], "period_s": PERIOD_S,
        "armature": [ROTOR],
    }  # fmt: skip
    return CurrentMotor().read(about, (JOINT,), "controller")


@cache
def trial_of(kind: str, commanded: bool) -> Trial:
    """The pendulum's log, described as a motor without a loop or without a controller."""
    made = without_speed(None)
    made = replace(made, arm=replace(made.arm, controller=motor() if kind == "motor" else None))
    return Trial(made if commanded else replace(made, command=None), RigidArm(made.arm))


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize(
    ("kind", "said"),
    [("motor", "`current_motor` is a motor without a loop"), ("none", "described controller")],
)
def test_a_recorded_command_is_not_what_is_missing(family: str, kind: str, said: str) -> None:
    """A log with its command was told that five families need the command."""
    effect = find_family(family)
    assert isinstance(effect, Effect)
    told = effect.why_unobservable(trial_of(kind, commanded=True))
    assert told is not None and said in told and "needs the command" not in told


@pytest.mark.parametrize("family", FAMILIES)
def test_without_a_command_it_is(family: str) -> None:
    effect = find_family(family)
    assert isinstance(effect, Effect)
    told = effect.why_unobservable(trial_of("motor", commanded=False))
    assert told is not None and "the command" in told and "law" not in told
