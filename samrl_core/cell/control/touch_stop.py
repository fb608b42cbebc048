"""A guarded motion: the tool goes slowly until it touches (guarded moves, Will and Grossman, 1975)."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from samrl_core.cell.control.tip_sense import TipSense
from samrl_core.cell.types.observation import ArmReading
from samrl_core.common.errors import InputError

TOUCH_DOWN = "touch_down"  # sub-goal of the actions that end where the tool touches


@dataclass(frozen=True)
class TouchStopSettings:
    """How fast it goes, and what ends it.

    Measured on 32 drawn cells whose plates a blade came down on (three of four as nobody calibrated them):
    at 10 mm/s the force on the way varies by 1.5 N over 25 mm and by less within the window; a touch raises
    it by `rise` within 26 ms and presses with 5 N at most, at 20 mm/s with up to 10 N.
    """

    speed: float = 0.010  # on its way; what the tool hits with grows with it [m/s]
    rise: float = 1.5  # of the force along the way over the least within the window, at a touch [N]
    window_s: float = 0.15  # friction and load change the force more slowly
    smooth_s: float = 0.008  # of the force, which scatters by 0.4 N from reading to reading
    settle_s: float = 0.11  # at the start the tool speeds up, and joints come unstuck

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0.0 < value < math.inf:
                raise InputError(f"{name} of a guarded motion is {value}, must be positive and finite")


class TouchStop:
    """Tells when a tool that moves touches something, from the readings of its arm.

    While joints slide, friction is no part of what torque sensors read, unlike at rest; offsets and load are
    as before the touch.

    Args:
        sense: of the tool.
        way: of the tip, (3,) in the tool arm's base frame [m].
        settings: what ends it.

    Raises:
        InputError: the way is not three finite numbers, or has no length.
    """

    def __init__(self, sense: TipSense, way: np.ndarray, settings: TouchStopSettings | None = None) -> None:
        way = np.asarray(way, dtype=np.float64)
        length = float(np.linalg.norm(way)) if way.shape == (3,) else math.nan
        if not 0.0 < length < math.inf:
            raise InputError(f"way of a guarded motion is {way}, must be three finite numbers [m], not all 0")
        self._sense, self._settings = sense, settings or TouchStopSettings()
        self._way = way / length
        self._recent: deque[tuple[int, float]] = deque()  # stamps [ns] and smoothed forces [N]
        self._began_ns = self._last_ns = -1
        self._force = 0.0

    def feels(self, reading: ArmReading) -> bool:
        """Whether it touches, by the newest reading; the first one begins the motion."""
        s = self._settings
        force = float(self._sense.read(reading).force @ self._way)
        if self._began_ns < 0:
            self._began_ns, self._force = reading.stamp_ns, force
        else:
            weight = 1.0 - math.exp(-(reading.stamp_ns - self._last_ns) * 1e-9 / s.smooth_s)
            self._force += weight * (force - self._force)
        self._last_ns = reading.stamp_ns
        if reading.stamp_ns - self._began_ns < s.settle_s * 1e9:
            return False
        self._recent.append((reading.stamp_ns, self._force))
        while self._recent[0][0] < reading.stamp_ns - s.window_s * 1e9:
            self._recent.popleft()
        return self._force - min(force for _, force in self._recent) > s.rise
