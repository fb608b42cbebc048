"""The last door before an arm: refuses bad commands, brakes when they stop coming, and stops on request.

Pure: time and measurements are passed in. A driver calls `accept` for each command it receives and `tick`
once a controller period; what `tick` returns is what the controller tracks. Age is counted from
reception, in two clocks: steady time, and robot time, which is simulated time in a simulation. The
smaller age counts, so that neither a simulation slower than real time nor a faster one trips it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from samrl_core.cell.control.brake import braked, resting
from samrl_core.cell.control.command_buffer import CommandCurve
from samrl_core.cell.control.command_rules import check_jump, check_step, check_values
from samrl_core.cell.control.guard_settings import GuardSettings, GuardState, GuardStatus
from samrl_core.cell.control.join import Join
from samrl_core.cell.robots.robot import JointLimits
from samrl_core.cell.types.observation import ArmCommand, ArmReading
from samrl_core.common.errors import InputError, LimitError, SamrlError

__all__ = ["CommandGuard", "GuardSettings", "GuardState", "GuardStatus"]

_LATCHED = (GuardState.FAULT, GuardState.ESTOP)


class CommandGuard:
    """One arm's guard. Commands are stamped with their time of validity, a little ahead.

    The set point follows the cubic through accepted commands. When the next is not there in time it slows
    down at once, and joins the curve again when it comes; after `timeout_s` without any it brakes to rest.
    """

    def __init__(
        self,
        limits: JointLimits,
        joint_names: tuple[str, ...],
        settings: GuardSettings | None = None,
        timeout_s: float | None = None,
    ) -> None:
        base = settings or GuardSettings()
        self._s = base if timeout_s is None else replace(base, timeout_s=timeout_s)
        if len(joint_names) != len(limits.lower):
            raise InputError(f"{len(joint_names)} joint names for limits of {len(limits.lower)} joints")
        self._limits = limits
        self._names = joint_names
        self._accepted = self._ignored = self._refused = self._late = 0
        self.restart()

    @property
    def status(self) -> GuardStatus:
        """State and counters."""
        return GuardStatus(
            self._state, self._reason, self._accepted, self._ignored, self._refused, self._late, self._since_s
        )

    def waits_for_command(self, robot_s: float, within_s: float) -> bool:
        """Whether commands are being tracked and none reaches `within_s` ahead.

        A simulation asks this before it advances, so as not to outrun the sender of the commands. How long it
        waits is its own affair: while it does, robot time and with it the age of the commands stands still.
        """
        if self._state is not GuardState.TRACKING:
            return False
        return self._curve.last.stamp_ns * 1e-9 - robot_s < within_s

    def restart(self) -> None:
        """Forget everything but the counters: the arm was placed anew, or robot time was set."""
        self._state, self._reason = GuardState.HOLD, ""
        self._curve = CommandCurve()
        self._commander = ""
        self._join: Join | None = None
        self._home: tuple[Join, np.ndarray] | None = None  # after a reset: the way to where the arm is (J,)
        self._received = (0.0, 0.0)  # steady, robot [s]
        self._setpoint: ArmCommand | None = None
        self._robot_s = self._since_s = 0.0

    def check(self, command: ArmCommand, measured: ArmReading) -> None:
        """The rules alone, without taking the command: for the output of whoever sends it.

        Raises:
            InputError: wrong size or a value that is not finite.
            LimitError: beyond a limit, or too far from the arm.
        """
        self._check(command, measured, 1.0)

    def accept(
        self,
        command: ArmCommand,
        measured: ArmReading,
        steady_s: float,
        robot_s: float,
        commander: str = "",
    ) -> bool:
        """Take a command that was just received; False when it was ignored.

        Whose command the arm begins to track is its commander until it holds still again.

        Ignored without harm, and counted: one not newer than one already taken, one that arrives after its
        time of validity, and any while the arm brakes or is stopped by a fault or e-stop.

        Args:
            command: stamped with its time of validity.
            measured: where the arm is.
            steady_s: steady clock at reception [s].
            robot_s: robot time at reception [s].
            commander: identity of the sender, such as its publisher's; empty where the caller has only one.

        Raises:
            InputError: wrong size or a value that is not finite. The guard is then in FAULT.
            LimitError: beyond a limit, a jump, or another commander. The guard is then in FAULT.
        """
        now_ns = round(robot_s * 1e9)
        tracking = self._state is GuardState.TRACKING
        if tracking and commander != self._commander:
            self._refused += 1
            reason = (
                f"command of {commander or 'an unknown sender'} while {self._commander or 'another'} commands"
                " the arm; one commander at a time: stop the other one"
            )
            self.fault(reason)
            raise LimitError(reason)
        newest_ns = self._curve.last.stamp_ns if tracking else -1
        if not (tracking or self._state is GuardState.HOLD) or command.stamp_ns <= newest_ns:
            self._ignored += 1
            return False
        if command.stamp_ns < max(now_ns, self._setpoint.stamp_ns if self._setpoint is not None else now_ns):
            self._late += 1
            return False
        try:
            self._take(command, measured, now_ns, tracking)
        except SamrlError as error:
            self._refused += 1
            self.fault(str(error))
            raise
        if not tracking:
            self._enter(GuardState.TRACKING, "")
            self._commander = commander
        self._received = (steady_s, robot_s)
        self._accepted += 1
        return True

    def fault(self, reason: str) -> None:
        """Brake and latch. The first reason stays; an e-stop in force stays one."""
        if self._state not in _LATCHED:
            self._enter(GuardState.FAULT, reason)

    def estop(self, reason: str) -> None:
        """Brake and latch."""
        if self._state is not GuardState.ESTOP:
            self._enter(GuardState.ESTOP, reason)

    def why_no_reset(self, measured: ArmReading) -> str:
        """Why `reset` would be refused now, empty when it would not."""
        if self._state not in _LATCHED:
            return ""
        speed, limit = float(np.abs(measured.velocity).max()), self._s.rest_velocity
        if not speed <= limit:  # so that NaN is refused
            return f"the arm still moves at {speed:.3f} rad/s, must be below {limit} rad/s"
        if self._setpoint is not None and self._setpoint.velocity.any():
            return "the set point still brakes; try again when it is at rest"
        return ""

    def reset(self, measured: ArmReading) -> str:
        """Leave a latched stop; returns why that is refused, empty when it is done.

        The set point is led to where the arm is: a step of it would be a step of the torque. From too far
        away it is set there, as the arm has long been elsewhere.
        """
        refusal = self.why_no_reset(measured)
        if not refusal and self._state in _LATCHED:
            robot_s, present = self._robot_s, self._setpoint
            self.restart()
            self._robot_s = self._since_s = robot_s
            if present is not None:
                self._lead_home(present, measured.position.copy())
        return refusal

    def _lead_home(self, present: ArmCommand, position: np.ndarray) -> None:
        try:
            join = Join(present, resting(position, present.stamp_ns), self._limits, self._names, self._s)
        except LimitError:
            return
        self._setpoint, self._home = present, (join, position)

    def tick(self, measured: ArmReading, steady_s: float, robot_s: float) -> ArmCommand:
        """What the controller tracks now.

        Raises:
            InputError: there is no set point yet and the measured position is not finite, or a clock is not.
        """
        if not (np.isfinite(steady_s) and np.isfinite(robot_s)):
            raise InputError(f"clocks must be finite, steady {steady_s} s, robot {robot_s} s")
        now_ns = round(robot_s * 1e9)
        present = self._present(measured, now_ns)
        if now_ns < present.stamp_ns:
            back = f"robot time went back from {present.stamp_ns * 1e-9:.3f} to {robot_s:.3f} s"
            self.fault(f"{back}; restart the guard when time is set")
            present = replace(present, stamp_ns=now_ns)
        self._robot_s = robot_s
        if self._state is GuardState.TRACKING:
            age = min(steady_s - self._received[0], robot_s - self._received[1])
            if age > self._s.timeout_s:
                text = f"no command for {age:.3f} s, limit {self._s.timeout_s} s: arm brakes"
                self._enter(GuardState.BRAKING, text)
        if self._state is GuardState.TRACKING:
            self._setpoint = self._tracked(present, now_ns)
        elif self._home is not None:
            join, position = self._home
            self._setpoint = join.applied(resting(position, now_ns))
            self._home = self._home if now_ns < join.end_ns else None
        else:
            self._setpoint = braked(present, now_ns, self._limits, self._s.brake_fraction)
            if self._state is GuardState.BRAKING and not self._setpoint.velocity.any():
                self._enter(GuardState.HOLD, self._reason)
        return self._setpoint

    def _enter(self, state: GuardState, reason: str) -> None:
        self._state, self._reason, self._since_s = state, reason, self._robot_s
        self._home = None
        if state is not GuardState.TRACKING:
            self._curve.clear()
            self._join = None

    def _present(self, measured: ArmReading, now_ns: int) -> ArmCommand:
        if self._setpoint is not None:
            return self._setpoint
        if measured.position.shape != self._limits.lower.shape or not np.isfinite(measured.position).all():
            raise InputError(f"measured position {measured.position} is no place to hold; check the driver")
        self._setpoint = resting(measured.position.copy(), now_ns)
        return self._setpoint

    def _check(self, command: ArmCommand, measured: ArmReading, share: float) -> None:
        check_values(command, self._limits, self._names, self._s, share)
        remedy = "wait for the arm, or reset from the measured position"
        check_jump(command, measured, self._names, self._s.tracking_jump_rad, remedy)

    def _take(self, command: ArmCommand, measured: ArmReading, now_ns: int, tracking: bool) -> None:
        ahead = (command.stamp_ns - now_ns) * 1e-9
        if ahead > self._s.max_ahead_s:
            raise LimitError(
                f"command is stamped {ahead:.3f} s ahead of robot time, limit {self._s.max_ahead_s} s; "
                "use the robot's clock"
            )
        joining = self._join is not None and command.stamp_ns < self._join.end_ns
        rest = 1.0 - self._s.join_fraction  # of the limits, beside a join
        share = rest if joining else 1.0
        self._check(command, measured, share)
        before = self._curve.last if tracking else None
        if before is not None:
            check_step(before, command, self._limits, self._names, self._s, share)
        else:
            remedy = "start from the measured position"
            check_jump(command, measured, self._names, self._s.start_jump_rad, remedy)
        present = self._present(measured, now_ns)
        off_curve = not tracking or present.stamp_ns > self._curve.last.stamp_ns
        self._curve.append(command)
        if off_curve:
            at = self._curve.at(present.stamp_ns)
            join = Join(present, at, self._limits, self._names, self._s)
            if join.end_ns > command.stamp_ns:
                self._check(command, measured, rest)
                if before is not None:
                    check_step(before, command, self._limits, self._names, self._s, rest)
            self._join = join if join.end_ns > join.start_ns else None

    def _tracked(self, present: ArmCommand, now_ns: int) -> ArmCommand:
        last = self._curve.last
        if now_ns <= last.stamp_ns:
            return self._joined(self._curve.at(now_ns))
        # The next command is late: slow down from the newest one rather than stop dead or run on.
        start = present if present.stamp_ns >= last.stamp_ns else self._joined(last)
        return braked(start, now_ns, self._limits, self._s.brake_fraction)

    def _joined(self, point: ArmCommand) -> ArmCommand:
        if self._join is None:
            return point
        if point.stamp_ns >= self._join.end_ns:
            self._join = None
            return point
        return self._join.applied(point)
