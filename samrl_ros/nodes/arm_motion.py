"""One arm's motion inside the manipulator: jerk-limited, checked, and with an end that is reported."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.control.smoother import JointSmoother
from samrl_core.cell.control.touch_stop import TouchStop
from samrl_core.cell.robots.arm_model import ArmModel, Payload
from samrl_core.cell.robots.robot import RobotSpec
from samrl_core.cell.types.observation import ArmCommand, ArmReading
from samrl_core.cell.types.pose import Pose

PERIOD_NS = 4_000_000  # between two set points, at whatever rate joint states come
_GAP_NS = 100_000_000  # a longer silence means that the driver started anew


@dataclass(frozen=True)
class MotionSettings:
    """How motions are executed."""

    velocity_scaling: float
    acceleration_scaling: float
    jerk_scaling: float
    stopped_velocity: float  # at rest below this [rad/s]
    goal_timeout_s: float  # after the set point has arrived [s]
    horizon_ns: int  # commands are stamped so far ahead of the reading they answer [ns]


@dataclass(frozen=True)
class MotionEnd:
    """How a motion ended."""

    reached: bool
    duration_s: float
    tracking_error: float  # largest joint error on the way [rad]


class ArmMotion:
    """Ticks on joint readings; commands are stamped about `horizon_ns` ahead of them.

    Set points lie on a grid of `PERIOD_NS` that begins with the first reading, and a command carries its grid
    time. Stamped by readings, which come at other rates and with jitter, its velocity would not be that of
    the step to the next command. A reading half a period before the next grid time is in time for it.
    """

    def __init__(
        self, spec: RobotSpec, base: Pose, payload: Payload | None, settings: MotionSettings
    ) -> None:
        self.spec = spec
        self.model = ArmModel(spec, base, payload)
        self._settings = settings
        self._smoother = JointSmoother(
            spec.limits,
            PERIOD_NS * 1e-9,
            velocity_scaling=settings.velocity_scaling,
            acceleration_scaling=settings.acceleration_scaling,
            jerk_scaling=settings.jerk_scaling,
        )
        self._last_ns = -1  # stamp of the last reading
        self._set_ns = -1  # grid time of the last set point
        self._started_ns = 0
        self._arrived_ns = -1
        self._tracking_error = 0.0
        self._ahead: list[tuple[int, np.ndarray]] = []  # commands not yet valid, to compare with readings
        self._touch: TouchStop | None = None  # that ends the motion
        self.busy = False
        self.stands = 0  # how often it was set to where it is measured
        self.reading: ArmReading | None = None
        self.commanded = np.zeros(len(spec.joint_names))

    def move(self, waypoints: list[np.ndarray], least_s: float = 0.0, touch: TouchStop | None = None) -> None:
        """Start towards waypoints (J,) [rad], smoothly from wherever the arm is; `least_s` as the smoother's.

        With `touch` it is a guarded motion: it ends, as one that arrived, where that is felt.

        Raises:
            LimitError: a waypoint beyond the limits; the motion in progress is not touched.
        """
        self._smoother.set_waypoints(waypoints, least_s)
        self.busy, self._touch = True, touch
        self._started_ns = self._last_ns
        self._arrived_ns = -1
        self._tracking_error = 0.0

    def stop(self) -> None:
        """Brake along the limits."""
        self._smoother.stop()

    def tick(self, reading: ArmReading) -> tuple[ArmCommand | None, MotionEnd | None, bool]:
        """Take a reading; returns the next command, the end of a motion if it just ended, and a restart flag.

        Restart: the first reading, or one after a gap. The set point is then where the arm is measured,
        and a motion in progress is void.
        """
        gap = reading.stamp_ns - self._last_ns
        self.reading = reading
        if self._last_ns < 0 or gap > _GAP_NS or gap < 0:
            void = self.stand(reading)
            return self._command(reading.stamp_ns, np.zeros_like(reading.position)), None, void
        self._last_ns = reading.stamp_ns
        steps = (reading.stamp_ns - self._set_ns + PERIOD_NS // 2) // PERIOD_NS
        if steps <= 0:
            return None, None, False
        self._set_ns += steps * PERIOD_NS
        if self._touch is not None and self._touch.feels(reading):
            self._touch = None
            self._smoother.stop()
        position, velocity, acceleration = self.commanded, np.zeros(0), np.zeros(0)
        for _ in range(steps):
            position, velocity, acceleration = self._smoother.step()
        self.commanded = position
        effort = self.model.effort_without_gravity(position, velocity, acceleration)
        stamp = self._set_ns + self._settings.horizon_ns
        self._track(reading, stamp)
        command = ArmCommand(stamp, position, velocity, acceleration, effort)
        return command, self._end(reading), False

    def stand(self, reading: ArmReading) -> bool:
        """Set the set point to where the arm is measured, at rest; returns whether a motion is void by it."""
        self.reading = reading
        self.stands += 1
        self._last_ns = self._set_ns = reading.stamp_ns
        self._smoother.reset(reading.position)
        self._touch = None
        self._ahead.clear()
        self.commanded = reading.position.copy()
        void, self.busy = self.busy, False
        return void

    def _command(self, stamp_ns: int, zeros: np.ndarray) -> ArmCommand:
        return ArmCommand(stamp_ns + self._settings.horizon_ns, self.commanded, zeros, zeros, zeros)

    def _track(self, reading: ArmReading, stamp: int) -> None:
        """Compare a reading with what was commanded for its time, between two set points in a row."""
        ahead = self._ahead
        ahead.append((stamp, self.commanded))
        while len(ahead) > 1 and ahead[1][0] <= reading.stamp_ns:
            ahead.pop(0)
        (begin, commanded), (end, then) = ahead[0], ahead[min(1, len(ahead) - 1)]
        if begin < reading.stamp_ns and end - begin == PERIOD_NS:
            commanded = commanded + (then - commanded) * ((reading.stamp_ns - begin) / PERIOD_NS)
        elif begin != reading.stamp_ns:
            return  # set points before the first reading, or one left out
        if self.busy:
            error = float(np.abs(commanded - reading.position).max())
            self._tracking_error = max(self._tracking_error, error)

    def _end(self, reading: ArmReading) -> MotionEnd | None:
        if not self.busy or not self._smoother.done:
            return None
        if self._arrived_ns < 0:
            self._arrived_ns = reading.stamp_ns
        waited_ns = reading.stamp_ns - self._arrived_ns
        if waited_ns < self._settings.horizon_ns:
            return None  # the last command is not yet valid
        at_rest = float(np.abs(reading.velocity).max()) < self._settings.stopped_velocity
        if not at_rest and waited_ns < self._settings.goal_timeout_s * 1e9:
            return None
        self.busy, self._touch = False, None
        return MotionEnd(at_rest, (reading.stamp_ns - self._started_ns) * 1e-9, self._tracking_error)
