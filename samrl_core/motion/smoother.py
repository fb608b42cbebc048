"""Jerk-limited joint motion, generated online by Ruckig (Berscheid and Kroeger, RSS 2021)."""

from __future__ import annotations

from collections import deque

import numpy as np
import ruckig

from samrl_core.errors import InputError, LimitError
from samrl_core.robots.robot import JointLimits

_BLEND_RAD = 0.02  # an intermediate waypoint counts as passed within this of it [rad]
_SLACK = 1e-9  # rounding of the generator on position limits [rad]


class JointSmoother:
    """One set point per period, continuous in position, velocity and acceleration, within the limits.

    Waypoints are a queue: the target becomes the next one as soon as the set point is within 0.02 rad of the
    present one, so that closely spaced waypoints of a straight line are run through without stopping.

    Args:
        limits: of the arm, each (J,).
        period_s: time between two calls of `step` [s].
        velocity_scaling: fraction of the velocity limits, 0..1.
        acceleration_scaling: fraction of the acceleration limits, 0..1.
        jerk_scaling: fraction of the jerk limits, 0..1.
    """

    def __init__(
        self,
        limits: JointLimits,
        period_s: float,
        velocity_scaling: float = 1.0,
        acceleration_scaling: float = 1.0,
        jerk_scaling: float = 1.0,
    ) -> None:
        for name, value in (
            ("velocity_scaling", velocity_scaling),
            ("acceleration_scaling", acceleration_scaling),
            ("jerk_scaling", jerk_scaling),
        ):
            if not 0.0 < value <= 1.0:
                raise InputError(f"{name} is {value}, must be above 0 and at most 1")
        self._limits = limits
        joints = len(limits.lower)
        self._otg = ruckig.Ruckig(joints, period_s)
        self._input = ruckig.InputParameter(joints)
        self._output = ruckig.OutputParameter(joints)
        self._input.max_velocity = (velocity_scaling * limits.velocity).tolist()
        self._input.max_acceleration = (acceleration_scaling * limits.acceleration).tolist()
        self._input.max_jerk = (jerk_scaling * limits.jerk).tolist()
        self._queue: deque[np.ndarray] = deque()
        self._done = True
        self.reset(0.5 * (limits.lower + limits.upper))

    @property
    def done(self) -> bool:
        """Whether the set point rests at the last target."""
        return self._done

    def reset(self, position: np.ndarray) -> None:
        """Start anew, at rest at a position (J,) [rad]."""
        position = self._checked(position)
        zeros = [0.0] * len(position)
        self._queue.clear()
        self._done = True
        self._input.control_interface = ruckig.ControlInterface.Position
        self._input.current_position = self._input.target_position = position.tolist()
        self._input.current_velocity = self._input.target_velocity = zeros
        self._input.current_acceleration = self._input.target_acceleration = zeros

    def set_target(self, position: np.ndarray) -> None:
        """Go to a position (J,) [rad] from wherever the set point is, and stop there."""
        self.set_waypoints([position])

    def set_waypoints(self, waypoints: list[np.ndarray]) -> None:
        """Go through positions (J,) [rad] and stop at the last.

        Raises:
            InputError: no waypoint, wrong length, or a value that is not finite; nothing changes.
            LimitError: a waypoint beyond a position limit; nothing changes.
        """
        if not waypoints:
            raise InputError("no waypoint given")
        checked = [self._checked(w) for w in waypoints]
        self._queue = deque(checked)
        self._input.control_interface = ruckig.ControlInterface.Position
        self._input.target_velocity = [0.0] * len(checked[0])
        self._aim()

    def stop(self) -> None:
        """Brake to rest along the limits, wherever that is."""
        self._queue.clear()
        self._done = False
        self._input.control_interface = ruckig.ControlInterface.Velocity
        self._input.target_velocity = [0.0] * len(self._limits.lower)
        self._input.target_acceleration = [0.0] * len(self._limits.lower)

    def step(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Position [rad], velocity [rad/s] and acceleration [rad/s2] one period later, each (J,).

        Raises:
            LimitError: no motion within the limits exists from here; the set point does not move.
        """
        if not self._done:
            result = self._otg.update(self._input, self._output)
            if result not in (ruckig.Result.Working, ruckig.Result.Finished):
                raise LimitError(f"no jerk-limited motion from here ({result}); reset from the measured position")
            self._output.pass_to_input(self._input)
            self._done = result == ruckig.Result.Finished and len(self._queue) <= 1
            if len(self._queue) > 1:
                near = np.abs(np.array(self._output.new_position) - self._queue[0]).max() < _BLEND_RAD
                if near or result == ruckig.Result.Finished:
                    self._queue.popleft()
                    self._aim()
        zeros = np.zeros(len(self._limits.lower))
        if self._done:
            return np.array(self._input.current_position), zeros, zeros
        return (
            np.array(self._output.new_position),
            np.array(self._output.new_velocity),
            np.array(self._output.new_acceleration),
        )

    def _aim(self) -> None:
        self._input.target_position = self._queue[0].tolist()
        self._done = False

    def _checked(self, position: np.ndarray) -> np.ndarray:
        q = np.asarray(position, dtype=np.float64)
        if q.shape != self._limits.lower.shape or not np.isfinite(q).all():
            raise InputError(f"joint position {q} must be {len(self._limits.lower)} finite numbers")
        low, high = self._limits.lower - _SLACK, self._limits.upper + _SLACK
        if (q < low).any() or (q > high).any():
            j = int(np.argmax(np.maximum(low - q, q - high)))
            raise LimitError(
                f"joint {j + 1} at {q[j]:.4f} rad, limits {self._limits.lower[j]:.4f} to "
                f"{self._limits.upper[j]:.4f} rad; choose a target inside"
            )
        return q.copy()
