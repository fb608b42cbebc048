"""How long simulated time stands still for commands that are late."""

from __future__ import annotations

import pytest

from samrl_ros.nodes.bridge.lockstep import LOOK_S, Lockstep


def test_patience_counts_the_time_of_looking() -> None:
    lockstep, looks = Lockstep(1.0), 0
    while lockstep.waits(True, 7, 0.01 * looks):
        looks += 1
        assert looks < 1000
    assert 0.01 * looks == pytest.approx(1.0, abs=0.011)


def test_time_in_which_the_process_did_not_run_costs_no_patience() -> None:
    """Stopped for a minute, or starved: commands that came meanwhile are not read yet."""
    lockstep = Lockstep(1.0)
    assert lockstep.waits(True, 7, 0.0)
    assert lockstep.waits(True, 7, 60.0)
    looks = 0
    while lockstep.waits(True, 7, 60.0 + 0.01 * looks):
        looks += 1
        assert looks < 1000
    assert 0.01 * looks > 1.0 - 2 * LOOK_S


def test_impatience_lasts_until_the_next_command() -> None:
    lockstep = Lockstep(0.0)
    assert not lockstep.waits(True, 7, 0.0) and not lockstep.waits(True, 7, 5.0)
    lockstep = Lockstep(0.05)
    for now in range(10):
        waits = lockstep.waits(True, 7, 0.01 * now)
    assert not waits
    assert lockstep.waits(True, 8, 0.1)


def test_nobody_waits_without_need() -> None:
    lockstep = Lockstep(1.0)
    assert not any(lockstep.waits(False, 7, float(now)) for now in range(100))
    assert lockstep.waits(True, 7, 100.0)
