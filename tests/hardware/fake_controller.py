"""What joint_trajectory_controller of ros2_controllers (Jazzy) does with a trajectory from its topic."""

from __future__ import annotations

from typing import Any

import numpy as np

from samrl_core.cell.types.observation import ArmReading

LATE = "the trajectory ends in the past"
State = tuple[np.ndarray, np.ndarray, np.ndarray]  # position, velocity, acceleration


class TrajectoryController:
    """Replaces the trajectory by each new one, and goes to its first point from where it would have been.

    Cubic between points with velocities; after the last point it stays. It refuses what the original refuses:
    other joints, efforts, times that do not grow, an end in motion, an end in the past.
    """

    def __init__(self, joints: list[str]) -> None:
        self.joints = joints
        self.late = 0  # trajectories
        self.forget()

    def forget(self) -> None:
        """As after activation."""
        self._points: list[tuple[int, np.ndarray, np.ndarray]] = []  # time [ns], position, velocity
        self.first_ns = 0  # time of the newest trajectory's first point

    def take(self, message: Any, now_ns: int, measured: ArmReading) -> None:
        """A trajectory that arrives at `now_ns` of the controller's clock."""
        why = self._why_refused(message, now_ns)
        if why == LATE:
            self.late += 1
            return
        if why:
            raise ValueError(why)
        state = self.sample(now_ns) or (
            measured.position,
            np.zeros_like(measured.position),
            measured.position,
        )
        order = [list(message.joint_names).index(name) for name in self.joints]
        start_ns = _ns(message.header.stamp)
        points = [(now_ns, np.array(state[0]), np.array(state[1]))]
        for point in message.points:
            time_ns = start_ns + _ns(point.time_from_start)
            if time_ns > now_ns:
                points.append((time_ns, np.array(point.positions)[order], np.array(point.velocities)[order]))
        self._points = points
        self.first_ns = start_ns

    def sample(self, now_ns: int) -> State | None:
        """Where the controller wants the arm, or None before the first trajectory."""
        if not self._points:
            return None
        points = self._points
        while len(points) > 1 and points[1][0] <= now_ns:
            points.pop(0)
        (t0, p0, v0) = points[0]
        zeros = np.zeros_like(p0)
        if len(points) == 1:
            return p0, v0, zeros
        (t1, p1, v1) = points[1]
        h, t = 1e-9 * (t1 - t0), 1e-9 * (now_ns - t0)
        a2 = (3 * (p1 - p0) - (2 * v0 + v1) * h) / h**2
        a3 = (2 * (p0 - p1) + (v0 + v1) * h) / h**3
        return (
            p0 + v0 * t + a2 * t**2 + a3 * t**3,
            v0 + 2 * a2 * t + 3 * a3 * t**2,
            2 * a2 + 6 * a3 * t,
        )

    def _why_refused(self, message: Any, now_ns: int) -> str:
        times = [_ns(p.time_from_start) for p in message.points]
        if sorted(message.joint_names) != sorted(self.joints):
            return f"joints {list(message.joint_names)} are not {self.joints}"
        if not times or any(b <= a for a, b in zip(times, times[1:], strict=False)):
            return f"times {times} do not grow"
        if any(len(p.effort) for p in message.points):
            return "efforts are not supported"
        if any(v != 0.0 for v in message.points[-1].velocities):
            return f"the trajectory ends in motion: {list(message.points[-1].velocities)}"
        if _ns(message.header.stamp) + times[-1] < now_ns:
            return LATE
        return ""


def _ns(time: Any) -> int:
    return int(time.sec) * 1_000_000_000 + int(time.nanosec)
