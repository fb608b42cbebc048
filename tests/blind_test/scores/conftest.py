"""Worlds of a fraction of a second: no programme is worked out, nothing is kept between tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from samrl_core.blind_test.engines import simulate
from samrl_core.blind_test.worlds import nominal, world
from samrl_core.cell.types.arm_recording import JointSignal


@pytest.fixture
def short_worlds(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A short swing in the place of every programme."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(nominal, "world_command", _swing)
    monkeypatch.setattr(world, "world_command", _swing)
    monkeypatch.setattr(simulate, "SETTLE_S", 0.1)
    for cached in (world._nominal, world._peak_rate, nominal.demands):
        cached.cache_clear()


def _swing(role: str, number: int, letter: str, duration_s: float) -> JointSignal:
    time = np.arange(0.0, duration_s, 0.001)
    swing = 0.3 * np.sin(2 * np.pi * time)[:, None] ** 2 * np.ones(7)
    position = nominal.nominal_arm(role).spec.home + swing
    velocity = np.gradient(position, time, axis=0)
    return JointSignal(time, position, velocity, np.gradient(velocity, time, axis=0), np.zeros_like(position))
