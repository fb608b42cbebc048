"""An effort limit that the model states and the servo does not have: its torque is computed, and clipped."""

from __future__ import annotations

from dataclasses import replace

import pytest

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.diagnosis.diagnose import diagnose
from samrl_core.diagnosis.kinds.arms import Arms
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.selection.exceeded_limits import find_exceeded_limits
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from tests.diagnosis.controllers.test_between_commands import recording


def limited(seed: int, limit: float, late_s: float = 0.0) -> ArmRecording:
    """The servo that follows lines between goals, with a URDF that states this limit [N m]."""
    made = recording(100.0, 100.0, False, late_s, seed)
    assert made.arm.urdf is not None
    text = made.arm.urdf.replace('effort="20"', f'effort="{limit}"')
    return replace(made, arm=replace(made.arm, urdf=text))


def trials(limit: float) -> list[Trial]:
    return [Trial(r, RigidArm(r.arm)) for r in (limited(seed, limit) for seed in range(2))]


def test_a_limit_that_the_motion_exceeds_is_told() -> None:
    """A pendulum of 2 N m was said to be limited to 1 N m, and a rate limit was the nearest cause."""
    found = find_exceeded_limits(trials(1.0))
    assert found is not None and found.joints == (0,) and found.limits == (1.0,)
    assert found.reached[0][1] > 1.5 and found.after < 0.1 * found.before
    (effect,) = found.named("tool_arm", ("swing",))
    assert effect.name == "torque_saturation@joint:swing"
    assert "1 N m of swing" in found.says
    lifted = found.corrected(limited(0, 1.0)).arm
    assert RigidArm(lifted).effort_limits()[0] > 1.2 * found.reached[0][1]


def test_a_limit_that_is_there_or_not_reached_stays() -> None:
    assert find_exceeded_limits(trials(20.0)) is None
    clipped = [Trial(r, RigidArm(r.arm)) for r in (limited(0, 1.0), limited(1, 1.0))]
    for trial in clipped:  # as if what the law asks for beyond it had not come
        law = trial.motion.described_law.total
        trial.residual["dynamics"] += trial.motion.reduce(law - law.clip(-1.0, 1.0))
    assert find_exceeded_limits(clipped) is None


def test_a_recorded_torque_is_no_law() -> None:
    """It says itself how large it was; nothing is clipped."""
    found = [replace(r, states=replace(r.states, effort=r.states.position)) for r in (limited(0, 1.0),)]
    assert Arms().misdescription([Trial(r, RigidArm(r.arm)) for r in found]) is None


@pytest.mark.thorough
def test_the_limit_is_named_and_nothing_beside_it() -> None:
    runs = [limited(seed, 1.0) for seed in range(3)]
    found, _ = diagnose(runs[:2], runs[2:])
    assert found.verdict == "effect", found.reasons
    assert [e.name for e in found.effects] == ["torque_saturation@joint:swing"]
    low, high = found.effects[0].parameters["L"].ci95
    assert 1.0 < low <= high
    assert found.gap is not None and found.gap.shrink is not None and found.gap.shrink > 0.7
    assert "no torque is limited to 1 N m of swing" in found.reasons[0]
