"""A guarded motion ends where the tool touches, and not where friction, load or noise change what is read."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from samrl_core.cell.control.tip_sense import TipReading
from samrl_core.cell.control.touch_stop import TouchStop, TouchStopSettings
from samrl_core.common.errors import InputError

DOWN = np.array([0.0, 0.0, -0.010])
STIFFNESS, NOISE = 2900.0, 0.4  # of a Panda's tip in its workspace [N/m], and a reading's force [N]
DRIFT = 0.6  # of the force per second, as measured at most on the way down [N/s]


class Descent:
    """Forces on a tip that goes down at 10 mm/s, read at a rate; `surface_mm` is below where it begins."""

    def __init__(self, surface_mm: float = math.inf, unstuck: float = 4.0, hz: float = 1000.0) -> None:
        self._surface, self._unstuck, self._hz = 1e-3 * surface_mm, unstuck, hz
        self._rng = np.random.default_rng(5)

    def read(self, arm: Any) -> TipReading:
        time = 1e-9 * arm.stamp_ns
        pushed = max(0.0, TouchStopSettings.speed * time - self._surface)
        start = self._unstuck if time < 0.08 else 0.0
        force = -3.0 + start + DRIFT * time + STIFFNESS * pushed + NOISE * self._rng.standard_normal()
        return TipReading(np.zeros(3), np.array([5.0, -2.0, -force]), np.eye(3))

    def stops_at(self, seconds: float = 2.5) -> float | None:
        """How far below the start the touch was felt [mm]; None without one."""
        touch = TouchStop(self, DOWN)
        for stamp_ns in range(0, round(seconds * 1e9), round(1e9 / self._hz)):
            reading: Any = SimpleNamespace(stamp_ns=stamp_ns)
            if touch.feels(reading):
                return 1e3 * TouchStopSettings.speed * 1e-9 * stamp_ns
        return None


@pytest.mark.parametrize("surface_mm", [2.0, 5.0, 20.0])
@pytest.mark.parametrize("hz", [250.0, 1000.0])
def test_a_touch_is_felt_within_a_millimetre(surface_mm: float, hz: float) -> None:
    found = Descent(surface_mm, hz=hz).stops_at()
    assert found is not None and surface_mm < found < surface_mm + 0.9


def test_what_is_touched_already_is_felt_before_it_is_pressed_by_six_newtons() -> None:
    found = Descent(0.0).stops_at()
    assert found is not None and found * 1e-3 * STIFFNESS < 6.0


@pytest.mark.parametrize("unstuck", [-6.0, 0.0, 6.0])
def test_nothing_is_felt_where_nothing_is(unstuck: float) -> None:
    assert Descent(unstuck=unstuck).stops_at() is None


@pytest.mark.parametrize("way", [np.zeros(3), np.array([0.0, math.nan, 0.1]), np.zeros(2)])
def test_a_way_without_direction_is_refused(way: np.ndarray) -> None:
    with pytest.raises(InputError, match="way of a guarded motion"):
        TouchStop(Descent(), way)


def test_settings_that_stop_nothing_are_refused() -> None:
    with pytest.raises(InputError, match="rise of a guarded motion is 0"):
        TouchStopSettings(rise=0.0)
