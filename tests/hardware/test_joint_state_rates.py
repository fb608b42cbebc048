"""Whatever rate and jitter joint states have, what answers them is one smooth curve that the guard takes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.control.guard import CommandGuard
from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.types.observation import ArmCommand, ArmReading
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import LimitError
from samrl_ros.nodes.arm_motion import PERIOD_NS, ArmMotion, MotionEnd, MotionSettings

SPEC = cell_named(DEFAULT_CELL).tool_arm
START_NS = 1_700_000_000_123_456_789
TURN = 0.6  # [rad] of the first joint
SETTINGS = MotionSettings(0.4, 0.4, 0.2, 0.01, 1.5, 40_000_000)


class Arm:
    """Follows exactly what the guard makes of the commands; its driver's clock is robot time."""

    def __init__(self) -> None:
        self.motion = ArmMotion(SPEC, Pose.identity(), None, SETTINGS)
        self.guard = CommandGuard(SPEC.limits, SPEC.joint_names)
        self.position, self.velocity = SPEC.home.copy(), np.zeros(7)
        self.commands: list[ArmCommand] = []
        self.end: MotionEnd | None = None

    def hear(self, stamp_ns: int) -> None:
        """A joint state; what is commanded goes to the guard, which raises for what it refuses."""
        robot_s = 1e-9 * stamp_ns
        before = ArmReading(stamp_ns, self.position, self.velocity, np.zeros(7))
        point = self.guard.tick(before, robot_s, robot_s)
        self.position, self.velocity = point.position, point.velocity
        reading = ArmReading(stamp_ns, self.position, self.velocity, np.zeros(7))
        command, end, _ = self.motion.tick(reading)
        if command is not None:
            self.commands.append(command)
            self.guard.accept(command, reading, robot_s, robot_s)
        self.end = self.end or end


def stamps(hz: float, jitter_s: float, seed: int = 0) -> np.ndarray:
    """Of 4 s of joint states, in order [ns]."""
    random = np.random.default_rng(seed)
    even = np.arange(round(4 * hz)) / hz
    return np.sort(
        START_NS + np.round(1e9 * (even + random.uniform(-jitter_s, jitter_s, even.size))).astype(int)
    )


def driven(hz: float, jitter_s: float) -> Arm:
    """One turn of the first joint, asked for after ten joint states."""
    arm = Arm()
    for k, stamp in enumerate(stamps(hz, jitter_s)):
        if k == 10:
            arm.motion.move([SPEC.home + TURN * np.eye(7)[0]])
        arm.hear(int(stamp))
    return arm


@pytest.mark.parametrize("hz", [90.0, 200.0, 249.7, 300.0, 1000.0])
@pytest.mark.parametrize("jitter_s", [0.0, 4e-4])
def test_the_guard_takes_every_command_and_the_motion_takes_its_time(hz: float, jitter_s: float) -> None:
    arm, even = driven(hz, jitter_s), driven(250.0, 0.0)
    assert arm.guard.status.refused == 0, arm.guard.status
    assert arm.end is not None and arm.end.reached and even.end is not None
    assert abs(arm.position[0] - SPEC.home[0] - TURN) < 1e-9
    assert abs(arm.end.duration_s - even.end.duration_s) <= 2 / hz + 1e-9 * PERIOD_NS
    assert arm.end.tracking_error < 1e-3
    steps = np.diff([c.stamp_ns for c in arm.commands])
    assert (steps % PERIOD_NS == 0).all() and steps.max() <= 1e9 / hz + 2 * PERIOD_NS


def test_a_command_stamped_by_a_jittering_reading_is_refused() -> None:
    """What the grid is for: the same set points 3 ms apart are faster than their velocities say."""
    arm = Arm()
    points = []
    arm.motion.tick(ArmReading(START_NS, SPEC.home, np.zeros(7), np.zeros(7)))
    arm.motion.move([SPEC.home + TURN * np.eye(7)[0]])
    for k in range(1, 200):
        command, _, _ = arm.motion.tick(
            ArmReading(START_NS + k * PERIOD_NS, SPEC.home, np.zeros(7), np.zeros(7))
        )
        assert command is not None
        points.append(command)
    reading = ArmReading(START_NS, SPEC.home, np.zeros(7), np.zeros(7))
    with pytest.raises(LimitError, match="what its velocities allow"):
        for k, point in enumerate(points):
            elapsed_s = 3e-3 * k
            squeezed = replace(point, stamp_ns=START_NS + round(1e9 * elapsed_s) + 1)
            arm.guard.accept(squeezed, reading, elapsed_s, 1e-9 * START_NS + elapsed_s)
