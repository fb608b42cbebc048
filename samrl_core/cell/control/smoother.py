"""Jerk-limited joint motion, generated online by Ruckig (Berscheid and Kroeger, RSS 2021)."""

from __future__ import annotations

import math
from collections import deque

import numpy as np
import ruckig

from samrl_core.cell.robots.robot import JointLimits
from samrl_core.common.errors import InputError, LimitError

_SLACK = 1e-9  # rounding of the generator on position limits [rad]


class JointSmoother:
    """One set point per period, continuous in position, velocity and acceleration, within the limits.

    Waypoints are a queue: the target becomes the next one as soon as every joint is within `blend_rad` of the
    present one, so that closely spaced waypoints of a straight line are run through without stopping, and a
    corner is cut by no more than about that. With 0 each waypoint is a stop. All joints arrive together.

    Args:
        limits: of the arm, each (J,).
        period_s: time between two calls of `step` [s].
        velocity_scaling: fraction of the velocity limits, 0..1.
        acceleration_scaling: fraction of the acceleration limits, 0..1.
        jerk_scaling: fraction of the jerk limits, 0..1.
        position_margin_rad: kept from position limits by every target [rad].
        blend_rad: an intermediate waypoint counts as passed within this of it [rad]. Smaller is straighter
            and slower: a tool line of 18 mm with waypoints 5 mm apart bows by 2.9 mm in 0.22 s at 0.02 rad,
            by 1.0 mm in 0.32 s at 0.0025 rad (Panda at home, 0.4 of velocity and acceleration, 0.2 of jerk).
        joint_names: for messages; by default joint 1, joint 2, ...

    Raises:
        InputError: a period, fraction, margin or blend that makes no sense.
    """

    def __init__(
        self,
        limits: JointLimits,
        period_s: float,
        velocity_scaling: float = 1.0,
        acceleration_scaling: float = 1.0,
        jerk_scaling: float = 1.0,
        position_margin_rad: float = 0.0,
        blend_rad: float = 0.0025,
        joint_names: tuple[str, ...] = (),
    ) -> None:
        for name, value in (
            ("velocity_scaling", velocity_scaling),
            ("acceleration_scaling", acceleration_scaling),
            ("jerk_scaling", jerk_scaling),
        ):
            if not 0.0 < value <= 1.0:
                raise InputError(f"{name} is {value}, must be above 0 and at most 1")
        for name, value in (("position_margin_rad", position_margin_rad), ("blend_rad", blend_rad)):
            if not 0.0 <= value < math.inf:
                raise InputError(f"{name} is {value}, must be finite and not negative")
        if not 0.0 < period_s < math.inf:
            raise InputError(f"period is {period_s} s, must be positive and finite")
        joints = len(limits.lower)
        self._names = joint_names or tuple(f"joint {j + 1}" for j in range(joints))
        if len(self._names) != joints:
            raise InputError(f"{len(self._names)} joint names for limits of {joints} joints")
        self._limits = limits
        self._margin, self._blend = position_margin_rad, blend_rad
        self._otg = ruckig.Ruckig(joints, period_s)
        self._input = ruckig.InputParameter(joints)
        self._output = ruckig.OutputParameter(joints)
        self._fastest = (
            velocity_scaling * limits.velocity,
            acceleration_scaling * limits.acceleration,
            jerk_scaling * limits.jerk,
        )
        self._queue: deque[np.ndarray] = deque()
        self._least_s = 0.0  # of the motion to a single target [s]
        self._done = True
        self.reset(0.5 * (limits.lower + limits.upper))

    @property
    def done(self) -> bool:
        """Whether the set point rests at the last target."""
        return self._done

    def reset(self, position: np.ndarray) -> None:
        """Start anew at rest at a position (J,) [rad].

        Raises:
            InputError: wrong length, or a value that is not finite; nothing changes.
            LimitError: beyond a limit; nothing changes.
        """
        q = self._checked_position(position, 0.0, "move the arm back inside by hand")
        self._input.current_position = q.tolist()
        self._input.current_velocity = [0.0] * len(q)
        self._input.current_acceleration = [0.0] * len(q)
        self.stop()
        self._done = True

    def set_waypoints(self, waypoints: list[np.ndarray], least_s: float = 0.0) -> None:
        """Go through positions (J,) [rad] and stop at the last; a single one takes `least_s` at least.

        Raises:
            InputError: no waypoint, wrong length, or a value that is not finite or negative; nothing changes.
            LimitError: a waypoint beyond a position limit; nothing changes.
        """
        if not waypoints:
            raise InputError("no waypoint given; give at least one")
        if not 0.0 <= least_s < math.inf:
            raise InputError(f"least_s is {least_s} s, must be finite and not negative")
        targets = [self._checked_target(w) for w in waypoints]
        self._least_s = least_s if len(targets) == 1 else 0.0
        self._queue = deque(targets)
        self._aim()

    def stop(self) -> None:
        """Brake to rest, wherever that is, each joint by itself as fast as the limits allow."""
        zeros = [0.0] * len(self._limits.lower)
        self._queue.clear()
        self._done = False
        self._limit(*self._fastest)
        self._input.control_interface = ruckig.ControlInterface.Velocity
        # Not synchronised: a joint that could stop at once must not run on, towards its limit.
        self._input.synchronization = ruckig.Synchronization.No
        self._input.target_velocity = zeros
        self._input.target_acceleration = zeros
        self._input.minimum_duration = None

    def step(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Position [rad], velocity [rad/s] and acceleration [rad/s2] one period later, each (J,).

        Raises:
            LimitError: no motion within the limits exists from here; the set point does not move.
        """
        if not self._done:
            result = self._otg.update(self._input, self._output)
            if result not in (ruckig.Result.Working, ruckig.Result.Finished):
                raise LimitError(
                    f"no motion within limits from here ({result}); reset from the measured position"
                )
            self._output.pass_to_input(self._input)
            self._advance(result == ruckig.Result.Finished)
        return (
            np.array(self._input.current_position),
            np.array(self._input.current_velocity),
            np.array(self._input.current_acceleration),
        )

    def _advance(self, arrived: bool) -> None:
        if len(self._queue) > 1:
            distance = float(np.abs(np.array(self._input.current_position) - self._queue[0]).max())
            if arrived or distance < self._blend:
                self._queue.popleft()
                self._aim()
        elif arrived:
            self._done = True
            zeros = [0.0] * len(self._limits.lower)
            self._input.current_velocity = zeros
            self._input.current_acceleration = zeros

    def _aim(self) -> None:
        zeros = [0.0] * len(self._limits.lower)
        self._input.control_interface = ruckig.ControlInterface.Position
        self._input.synchronization = ruckig.Synchronization.Time
        self._input.target_position = self._queue[0].tolist()
        self._input.target_velocity = zeros
        self._input.target_acceleration = zeros
        self._input.minimum_duration = self._least_s or None
        self._limit(*self._limits_along_a_line())
        self._done = False

    def _limits_along_a_line(self) -> tuple[np.ndarray, ...]:
        """Limits that keep a motion from rest to rest on a straight line; those of the arm for any other.

        Views and sub-goals are found clear along that line of joint space. Joints that share a motion's time
        but have limits of their own leave it, by up to 6 cm at the camera; Ruckig's phase synchronisation
        falls back to that where ratios of limits differ.
        """
        way = np.abs(self._queue[0] - np.array(self._input.current_position))
        goes = way > _SLACK
        moving = np.any(self._input.current_velocity) or np.any(self._input.current_acceleration)
        if moving or not goes.any():
            return self._fastest
        return tuple(np.where(goes, way * np.min(limit[goes] / way[goes]), limit) for limit in self._fastest)

    def _limit(self, velocity: np.ndarray, acceleration: np.ndarray, jerk: np.ndarray) -> None:
        self._input.max_velocity = velocity.tolist()
        self._input.max_acceleration = acceleration.tolist()
        self._input.max_jerk = jerk.tolist()

    def _checked_target(self, position: np.ndarray) -> np.ndarray:
        return self._checked_position(position, self._margin, "choose a target inside")

    def _checked_position(self, position: np.ndarray, margin: float, remedy: str) -> np.ndarray:
        q = self._finite(position, "position", "rad")
        low, high = self._limits.lower + margin, self._limits.upper - margin
        outside = np.maximum(low - q, q - high)
        if outside.max() > _SLACK:
            j = int(np.argmax(outside))
            raise LimitError(
                f"{self._names[j]} at {q[j]:.4f} rad, allowed {low[j]:.4f} to {high[j]:.4f} rad; {remedy}"
            )
        return q

    def _finite(self, values: np.ndarray, what: str, unit: str) -> np.ndarray:
        q = np.array(values, dtype=np.float64)
        if q.shape != self._limits.lower.shape:
            raise InputError(f"{what} has shape {q.shape}, must be {self._limits.lower.shape}: one per joint")
        if not np.isfinite(q).all():
            j = int(np.flatnonzero(~np.isfinite(q))[0])
            raise InputError(f"{what} of {self._names[j]} is {q[j]} {unit}, must be finite")
        return q
