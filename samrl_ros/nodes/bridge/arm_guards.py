"""The command guards of both arms, as a driver process holds them: commands in, set points and safety out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from samrl_core.cell.control.guard import CommandGuard, GuardState
from samrl_core.cell.robots.robot import ROLES, CellSpec
from samrl_core.cell.types.observation import ArmCommand, ArmReading
from samrl_core.common.errors import SamrlError
from samrl_ros.contract.behaviour import Outbox
from samrl_ros.contract.topics import cell_topic
from samrl_ros.conversions import from_message, to_message
from samrl_ros.nodes.standstill import why_rivals

COMMAND_TIMEOUT_S = 0.1  # default age of a command, by reception, at which the arm brakes [s]
_LATCHED = (GuardState.FAULT, GuardState.ESTOP)


class ArmGuards:
    """One guard per arm. What they refuse is logged, what they do is told on `safety_state`.

    Robot time is passed in [s]: simulated time, or the drivers' own.
    """

    def __init__(
        self, outbox: Outbox, cell: CellSpec, timeout_s: float, steady_s: Callable[[], float]
    ) -> None:
        self._outbox = outbox
        self._cell = cell
        self._steady_s = steady_s
        self._guards = {
            r: CommandGuard(cell.arm(r).limits, cell.arm(r).joint_names, timeout_s=timeout_s) for r in ROLES
        }
        # Robot time of the last message about it [s].
        self._dropped_log_s: dict[str, float] = dict.fromkeys(ROLES, -1.0)
        self._rivals: dict[str, tuple[str, ...]] = {}  # who was told of while the arm is stopped
        self._was_moving: dict[str, bool] = dict.fromkeys(ROLES, False)  # at the last `is_in_charge`
        self._told: tuple[Any, ...] = ()
        self.refused_commands = 0
        self.least_lead_ms = float("inf")  # validity stamp minus time of arrival, worst since last asked [ms]

    def on_command(
        self, role: str, message: Any, reading: ArmReading, robot_s: float, commander: str = ""
    ) -> None:
        """A message on `<arm>/command` of a commander; one that the guard refuses never reaches the arm."""
        guard = self._guards[role]
        try:
            command = from_message.arm_command(message, self._cell.arm(role).joint_names)
            self.least_lead_ms = min(self.least_lead_ms, 1e-6 * command.stamp_ns - 1e3 * robot_s)
            if not guard.accept(command, reading, self._steady_s(), robot_s, commander):
                self._report_dropped(role, robot_s)
        except SamrlError as error:
            self.refused_commands += 1
            guard.fault(str(error))
            self._outbox.log("error", f"{role}: command refused, arm brakes: {error}")

    def on_rivals(self, role: str, publishers: Sequence[str]) -> None:
        """More than one publisher has a say on `<arm>/command`: the arm brakes, and all are named."""
        self.refused_commands += 1
        reason = why_rivals(role, publishers)
        if not self.is_latched(role):
            self.fault(role, reason)
        elif self._rivals.get(role) != tuple(publishers):
            self._outbox.log("error", f"{role}: the arm is stopped already: {reason}")
        self._rivals[role] = tuple(publishers)

    def fault(self, role: str, reason: str) -> None:
        """Brake an arm and latch."""
        self._guards[role].fault(reason)
        self._outbox.log("error", f"{role}: arm brakes: {reason}")

    def tick(self, role: str, reading: ArmReading, robot_s: float) -> ArmCommand:
        """What an arm's controller tracks now."""
        return self._guards[role].tick(reading, self._steady_s(), robot_s)

    def release(self, role: str) -> None:
        """No more commands are expected: an arm that stands is let go without an alarm."""
        if self._guards[role].status.state is GuardState.TRACKING and not self._was_moving[role]:
            self.restart(role)

    def is_in_charge(self, role: str, point: ArmCommand) -> bool:
        """Whether a controller has to be told `point`, just returned by `tick`: commands are followed, or the
        arm brakes. Once it holds still, nothing more is said; others may move it then."""
        moving = bool(point.velocity.any())
        told = self._guards[role].status.state is GuardState.TRACKING or moving or self._was_moving[role]
        self._was_moving[role] = moving
        return told

    def waits_for_commands(self, robot_s: float, within_s: float) -> bool:
        """Whether simulated time should stand still: an arm's next commands are due and still under way."""
        return any(guard.waits_for_command(robot_s, within_s) for guard in self._guards.values())

    @property
    def taken(self) -> int:
        """Commands taken so far."""
        return sum(guard.status.accepted for guard in self._guards.values())

    def is_latched(self, role: str) -> bool:
        """Whether an arm brakes or stands until somebody resets it."""
        return self._guards[role].status.state in _LATCHED

    def is_estopped(self) -> bool:
        """Whether an emergency stop is latched."""
        return any(guard.status.state is GuardState.ESTOP for guard in self._guards.values())

    def restart(self, role: str) -> None:
        """An arm was placed anew: forget all but the counters."""
        self._guards[role].restart()
        self._dropped_log_s[role] = -1.0
        self._rivals.pop(role, None)

    def estop(self, reason: str) -> None:
        """Emergency stop of both arms, latched."""
        for guard in self._guards.values():
            guard.estop(reason)
        self._outbox.log("error", f"emergency stop: {reason}")

    def reset(self, readings: Mapping[str, ArmReading]) -> str:
        """Explicit reset of both arms, or of neither; returns why it was refused, empty when done."""
        reasons = {role: guard.why_no_reset(readings[role]) for role, guard in self._guards.items()}
        if any(reasons.values()):
            return "; ".join(f"{role}: {reason}" for role, reason in reasons.items() if reason)
        for role, guard in self._guards.items():
            guard.reset(readings[role])
        self._rivals.clear()
        return ""

    def publish_safety(self) -> None:
        """Tell `safety_state`, if it has changed."""
        states = tuple((role, g.status.state, g.status.reason) for role, g in self._guards.items())
        if states == self._told:
            return
        self._told = states
        bad = [s for s in states if s[1] in _LATCHED]
        warned = [s for s in states if s[2]]  # braking, or holding because commands stopped coming
        level = 2 if bad else 1 if warned else 0
        text = "; ".join(f"{role}: {reason}" for role, _, reason in bad or warned) or "ok"
        values = {role: state.name for role, state, _ in states}
        self._outbox.publish(
            cell_topic("safety_state"), to_message.diagnostic("cell: command guard", level, text, values)
        )

    def _report_dropped(self, role: str, robot_s: float) -> None:
        """Log commands that the guard dropped while it tracks, at most once per second of robot time."""
        status = self._guards[role].status
        if status.state is not GuardState.TRACKING or robot_s < self._dropped_log_s[role] + 1.0:
            return
        self._dropped_log_s[role] = robot_s
        self._outbox.log(
            "warn",
            f"{role}: commands dropped so far: {status.ignored} not newer than one already taken, "
            f"{status.late} after their time of validity",
        )
