"""The last door before an arm: refuses bad commands, brakes when they stop coming, and stops on request.

Pure: time and measurements are passed in. A driver calls `accept` for each command it receives and `tick`
once a controller period; what `tick` returns is what the controller tracks. Age is counted from
reception, in two clocks: steady time, and robot time, which is simulated time in a simulation. The
smaller age counts, so that neither a simulation slower than real time nor a faster one trips it.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from samrl_core.errors import SamrlError
from samrl_core.robots.robot import JointLimits
from samrl_core.safety.rules import check_jump, check_step, check_values
from samrl_core.safety.settings import GuardSettings, GuardState, GuardStatus
from samrl_core.types.observation import ArmCommand, ArmReading

__all__ = ["CommandGuard", "GuardSettings", "GuardState", "GuardStatus"]


class CommandGuard:
    """One arm's guard. Commands are stamped with their time of validity, a little ahead.

    Between two accepted commands the set point is the cubic Hermite curve through their positions and
    velocities; after the last, and before the next is due, it decelerates.
    """

    def __init__(
        self,
        limits: JointLimits,
        joint_names: tuple[str, ...],
        settings: GuardSettings | None = None,
        timeout_s: float | None = None,
    ) -> None:
        base = settings or GuardSettings()
        self._s = base if timeout_s is None else GuardSettings(**{**base.__dict__, "timeout_s": timeout_s})
        self._limits = limits
        self._names = joint_names
        self._deceleration = self._s.brake_fraction * limits.acceleration
        self._accepted = self._ignored = self._refused = 0
        self.restart()

    @property
    def status(self) -> GuardStatus:
        """State and counters."""
        return GuardStatus(self._state, self._reason, self._accepted, self._ignored, self._refused)

    def restart(self) -> None:
        """Forget everything but the counters: the arm was placed anew."""
        self._state, self._reason = GuardState.HOLD, ""
        self._buffer: deque[ArmCommand] = deque()
        self._received = (0.0, 0.0)  # steady, robot [s]
        self._setpoint: ArmCommand | None = None

    def check(self, command: ArmCommand, measured: ArmReading) -> None:
        """The rules alone, without taking the command: for the output of whoever sends it.

        Raises:
            InputError: wrong size or a value that is not finite.
            LimitError: beyond a limit, or too far from the arm.
        """
        check_values(command, self._limits, self._names, self._s)
        remedy = "wait for the arm, or reset from the measured position"
        check_jump(command, measured, self._names, self._s.tracking_jump_rad, remedy)

    def accept(self, command: ArmCommand, measured: ArmReading, steady_s: float, robot_s: float) -> bool:
        """Take a command that was just received; False when it was ignored.

        Ignored without harm: older than one already taken, or while stopped by a fault or e-stop.

        Raises:
            InputError: wrong size or a value that is not finite. The caller then calls `fault`.
            LimitError: beyond a limit, or a jump. The caller then calls `fault`.
        """
        if self._state in (GuardState.FAULT, GuardState.ESTOP):
            self._ignored += 1
            return False
        newest = self._buffer[-1] if self._buffer else self._setpoint
        if command.stamp_ns <= (newest.stamp_ns if newest is not None else -1) or command.stamp_ns < robot_s * 1e9:
            self._ignored += 1
            return False
        try:
            self.check(command, measured)
            if self._state is GuardState.TRACKING and self._buffer:
                check_step(self._buffer[-1], command, self._limits, self._names, self._s.slack)
            else:
                remedy = "start from the measured position"
                check_jump(command, measured, self._names, self._s.start_jump_rad, remedy)
        except SamrlError:
            self._refused += 1
            raise
        if self._state is not GuardState.TRACKING:
            self._buffer.clear()
            self._state, self._reason = GuardState.TRACKING, ""
        self._buffer.append(command)
        self._received = (steady_s, robot_s)
        self._accepted += 1
        return True

    def fault(self, reason: str) -> None:
        """Brake and latch; an e-stop in force stays one."""
        if self._state is not GuardState.ESTOP:
            self._enter(GuardState.FAULT, reason)

    def estop(self, reason: str) -> None:
        """Brake and latch."""
        self._enter(GuardState.ESTOP, reason)

    def reset(self, measured: ArmReading) -> str:
        """Leave a latched stop; returns why that is refused, empty when it is done."""
        if self._state not in (GuardState.FAULT, GuardState.ESTOP):
            return ""
        speed = float(np.abs(measured.velocity).max())
        if speed > self._s.rest_velocity:
            return f"the arm still moves at {speed:.3f} rad/s, must be below {self._s.rest_velocity} rad/s"
        self.restart()
        return ""

    def tick(self, measured: ArmReading, steady_s: float, robot_s: float) -> ArmCommand:
        """What the controller tracks now."""
        now_ns = round(robot_s * 1e9)
        if self._setpoint is None:
            self._setpoint = _resting(measured.position, now_ns)
        if self._state is GuardState.TRACKING:
            age = min(steady_s - self._received[0], robot_s - self._received[1])
            if age > self._s.timeout_s:
                self._enter(GuardState.BRAKING, f"no command for {age:.3f} s, limit {self._s.timeout_s} s: arm brakes")
        if self._state is GuardState.TRACKING:
            self._setpoint = self._interpolated(self._setpoint, now_ns)
        else:
            self._setpoint = self._braked(self._setpoint, now_ns)
        return self._setpoint

    def _enter(self, state: GuardState, reason: str) -> None:
        self._state, self._reason = state, reason
        self._buffer.clear()

    def _interpolated(self, present: ArmCommand, now_ns: int) -> ArmCommand:
        while len(self._buffer) > 1 and self._buffer[1].stamp_ns <= now_ns:
            self._buffer.popleft()
        first = self._buffer[0]
        if first.stamp_ns > now_ns:
            return _hermite(present, first, now_ns) if present.stamp_ns < now_ns else present
        if len(self._buffer) == 1:
            if now_ns == first.stamp_ns:
                return first
            # Commands are late: slow down from the newest one rather than stop dead or run on.
            return self._braked(present if present.stamp_ns >= first.stamp_ns else first, now_ns)
        return _hermite(first, self._buffer[1], now_ns)

    def _braked(self, present: ArmCommand, now_ns: int) -> ArmCommand:
        """Each joint decelerates by a constant fraction of its limit, and stays inside its position limits."""
        dt = max(0.0, (now_ns - present.stamp_ns) * 1e-9)
        speed = np.abs(present.velocity)
        if not speed.any():
            return _resting(present.position, now_ns)
        slower = np.maximum(0.0, speed - self._deceleration * dt) * np.sign(present.velocity)
        travel = np.where(
            speed > self._deceleration * dt,
            0.5 * (present.velocity + slower) * dt,
            0.5 * present.velocity * speed / self._deceleration,
        )
        position = np.clip(present.position + travel, self._limits.lower, self._limits.upper)
        zeros = np.zeros_like(position)
        return ArmCommand(now_ns, position, slower, -np.sign(slower) * self._deceleration, zeros)


def _resting(position: np.ndarray, stamp_ns: int) -> ArmCommand:
    zeros = np.zeros(len(position))
    return ArmCommand(stamp_ns, position, zeros, zeros, zeros)


def _hermite(a: ArmCommand, b: ArmCommand, now_ns: int) -> ArmCommand:
    """Cubic through positions and velocities of two commands; acceleration and torque change linearly."""
    h = (b.stamp_ns - a.stamp_ns) * 1e-9
    s = (now_ns - a.stamp_ns) * 1e-9 / h
    s2, s3 = s * s, s * s * s
    position = (
        (2 * s3 - 3 * s2 + 1) * a.position
        + (s3 - 2 * s2 + s) * h * a.velocity
        + (3 * s2 - 2 * s3) * b.position
        + (s3 - s2) * h * b.velocity
    )
    velocity = (
        (6 * s2 - 6 * s) * (a.position - b.position) / h
        + (3 * s2 - 4 * s + 1) * a.velocity
        + (3 * s2 - 2 * s) * b.velocity
    )
    acceleration = (1 - s) * a.acceleration + s * b.acceleration
    effort = (1 - s) * a.effort + s * b.effort
    return ArmCommand(now_ns, position, velocity, acceleration, effort)
