"""Filters and queues on the way of the command to the controller, or of the effort to the drive."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from samrl_core.cell.types.arm_recording import JointSignal

_FIELDS = ("position", "velocity", "acceleration", "effort")


def map_command(
    command: JointSignal, joints: list[int], change: Callable[[np.ndarray], np.ndarray]
) -> JointSignal:
    """The command with `change` (N, j) -> (N, j) done to some joints' channels."""
    changed = {}
    for name in _FIELDS:
        values = getattr(command, name)
        if values is not None:
            changed[name] = values.copy()
            changed[name][:, joints] = change(values[:, joints])
    return replace(command, **changed)


def recursive(b: np.ndarray, a: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """A digital filter of unit gain that starts at rest at the first sample."""

    def run(values: np.ndarray) -> np.ndarray:
        first = values[:1]
        return lfilter(b, a, values - first, axis=0) + first

    return run


class RunningFilter:
    """The same filter on the effort, sample by sample, for some joints."""

    def __init__(self, b: np.ndarray, a: np.ndarray, joints: list[int]) -> None:
        self._b, self._a, self._joints = b / a[0], a / a[0], joints
        self._x: np.ndarray | None = None
        self._y: np.ndarray | None = None

    def __call__(self, t: float, u: np.ndarray) -> np.ndarray:
        """Filtered effort (J,)."""
        now = u[self._joints]
        if self._x is None or self._y is None:
            self._x = np.repeat(now[None], len(self._b), axis=0)
            self._y = np.repeat(now[None], len(self._a) - 1, axis=0)
        self._x = np.concatenate([now[None], self._x[:-1]])
        y = self._b @ self._x - self._a[1:] @ self._y
        self._y = np.concatenate([y[None], self._y[:-1]])
        out = u.copy()
        out[self._joints] = y
        return out


class Queue:
    """Effort as it was `delay(t)` seconds ago, between samples by a straight line."""

    def __init__(self, delay: Callable[[float], float], joints: list[int], period: float) -> None:
        self._delay, self._joints, self._period = delay, joints, period
        self._past: list[np.ndarray] = []

    def __call__(self, t: float, u: np.ndarray) -> np.ndarray:
        """Delayed effort (J,)."""
        self._past.append(u[self._joints])
        if len(self._past) > 200:
            self._past.pop(0)
        back = self._delay(t) / self._period
        whole = int(back)
        last = len(self._past) - 1
        newer, older = self._past[max(last - whole, 0)], self._past[max(last - whole - 1, 0)]
        out = u.copy()
        out[self._joints] = newer + (back - whole) * (older - newer)
        return out


def delayed(values: np.ndarray, time: np.ndarray, delay: np.ndarray) -> np.ndarray:
    """Values (N, j) as they were `delay` (N,) seconds ago; before the first sample, the first."""
    at = time - delay
    return np.stack([np.interp(at, time, column) for column in values.T], axis=1)
