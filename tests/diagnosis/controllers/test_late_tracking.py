"""Servos that only log where they are and follow late, in logs that begin in mid-motion: NumPy alone."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.diagnose import diagnose
from samrl_core.diagnosis.residuals.trial import Trial

RATE_HZ, SECONDS, NOISE = 100.0, 16.0, 3e-5
JOINTS = ("pan", "tilt", "roll")


def recording(late_s: float, seed: int, rest_s: float = 0.0) -> ArmRecording:
    """Three joints under sums of sines, from the first sample on or after a rest."""
    rng = np.random.default_rng(seed)
    hertz, phase = rng.uniform(0.1, 0.7, (5, 3)), rng.uniform(0.0, 2.0 * np.pi, (5, 3))
    time = np.arange(0.0, SECONDS, 1.0 / RATE_HZ)

    def goal(at: np.ndarray) -> np.ndarray:
        on = np.maximum(at - rest_s, 0.0 if rest_s else -np.inf)[:, None, None]
        return 0.15 * np.sum(np.sin(2.0 * np.pi * hertz * on + phase), axis=1)

    position = goal(time - late_s) + NOISE * rng.standard_normal((len(time), 3))
    speed = np.gradient(position, time, axis=0)
    arm = ArmDescription("tool_arm", JOINTS, None, None)
    states, command = JointSignal(time, position, speed), JointSignal(time, goal(time))
    return ArmRecording(f"run {seed}", f"run{seed}", "", arm, states, command, None)


@pytest.mark.thorough
@pytest.mark.parametrize("late_s", [0.016, 0.048, 0.1, 0.2, 0.3])
def test_a_delay_is_as_long_as_it_is_though_the_log_begins_in_motion(late_s: float) -> None:
    found, _ = diagnose([recording(late_s, 1)], [recording(late_s, 2)])
    assert [e.name for e in found.effects] == ["command_delay@arm:tool_arm"], found.reasons
    size = found.effects[0].parameters["T"]
    assert size.ci95[0] < late_s < size.ci95[1]
    assert size.value == pytest.approx(late_s, rel=0.05, abs=1e-3)


@pytest.mark.thorough
def test_nothing_is_late_where_nothing_is() -> None:
    assert diagnose([recording(0.0, 1)], [recording(0.0, 2)])[0].verdict == "no_gap"


def test_a_log_that_begins_in_motion_says_nothing_until_its_own_commands_arrive() -> None:
    moving, rested = (Trial(recording(0.1, 1, rest_s), None) for rest_s in (0.0, 1.0))
    early = moving.elapsed("tracking") < 0.5
    assert np.all(moving.settled[early] == 0.0) and np.all(moving.residual["tracking"][early] == 0.0)
    assert np.all(moving.settled[~early] == 1.0)
    assert np.all(rested.settled == 1.0)
