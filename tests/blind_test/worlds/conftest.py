"""Short worlds: commands of a second or two, made here, so that no test waits for a long simulation."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.blind_test.engines import simulate
from samrl_core.blind_test.worlds import nominal, world
from samrl_core.cell.types.arm_recording import JointSignal


def short_command(role: str, number: int, letter: str, duration_s: float) -> JointSignal:
    """Sines about home with reversals, from rest; stands in for a programme."""
    home = nominal.nominal_arm(role).spec.home
    time = np.arange(0.0, duration_s, 0.001)
    pace = 2 * np.pi * np.array([0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2]) * (1.0 + 0.1 * number)
    rise = np.clip(time / 0.25, 0.0, 1.0)[:, None]
    smooth = rise**3 * (10 - 15 * rise + 6 * rise**2)
    position = home + 0.25 * smooth * np.sin(pace * time[:, None])
    velocity = np.gradient(position, time, axis=0)
    return JointSignal(time, position, velocity, np.gradient(velocity, time, axis=0), np.zeros_like(position))


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.getbasetemp() / "cache"))
    monkeypatch.setattr(nominal, "world_command", short_command)
    monkeypatch.setattr(world, "world_command", short_command)
    monkeypatch.setattr(simulate, "SETTLE_S", 0.1)
    world._nominal.cache_clear()
    world._peak_rate.cache_clear()
    nominal.demands.cache_clear()
