"""Logs that miss rows or are stamped late: samples stand on the log's own clock, wherever they belong."""

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.diagnosis.residuals.signals.sample_times import regular, sample_times
from samrl_core.diagnosis.residuals.signals.signal_band import onto_grid
from tests.diagnosis import worlds

PERIOD = 0.004


def _log(late: float, own: bool, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ticks (N,), stamps (N,) and positions (N, 1) of a swing, one row of 200 missing.

    Args:
        late: standard deviation of stamps in periods.
        own: whether each sample is taken at its stamp.
        seed: of both.
    """
    rng = np.random.default_rng(seed)
    ticks = PERIOD * np.flatnonzero(rng.random(4000) > 0.005)
    stamps = ticks + PERIOD * np.clip(late * rng.normal(size=len(ticks)), -0.4, 0.4)
    swing = np.sin(2.0 * np.pi * 0.7 * (stamps if own else ticks))
    return ticks, stamps, swing[:, None] + 2e-5 * rng.normal(size=(len(ticks), 1))


@pytest.mark.parametrize("late", [0.0, 0.03, 0.1])
def test_rows_that_are_missing_keep_the_clock(late):
    """Twenty missing rows of 4000 move no other's tick by more than a hundredth of a period."""
    ticks, stamps, _ = _log(late, own=False)
    assert np.abs(regular(stamps) - ticks).max() < 0.01 * PERIOD


@pytest.mark.parametrize("own", [True, False])
def test_positions_on_the_grid_are_those_of_its_times(own):
    """With rows missing and stamps off by a tenth of a period, whichever of both the samples follow."""
    _, stamps, read = _log(0.1, own)
    taken = sample_times(stamps, read)
    assert taken.own == own
    grid = PERIOD * np.arange(5, 3990)
    on_grid = onto_grid(taken, read, grid)
    # Of 4.4 rad/s half a period is 9 mrad, a tenth of one 1.8 mrad.
    assert np.abs(on_grid[:, 0] - np.sin(2.0 * np.pi * 0.7 * grid)).max() < 4e-4


def test_a_clock_without_gaps_and_one_that_none_keeps_are_as_before():
    """Stamps of whole milliseconds at 400 Hz belong to a clock; random ones to none."""
    every = 0.0025 * np.arange(3000)
    assert np.abs(regular(np.round(every, 3)) - every).max() < 2e-4
    wild = np.cumsum(np.random.default_rng(1).exponential(PERIOD, size=3000))
    assert regular(wild) is wild


def test_a_command_that_somebody_differenced_is_differenced_on_its_clock():
    """Over stamps that jitter by 3 % a speed would be off by 2 % of itself, at random."""
    recording = worlds.world(3, "B")[0]
    command = recording.command
    assert command is not None and command.position is not None
    rng = np.random.default_rng(0)
    step = float(np.median(np.diff(command.time)))
    stamps = command.time + step * np.clip(0.03 * rng.normal(size=len(command)), -0.4, 0.4)
    differenced = np.gradient(command.position, stamps, axis=0)
    late = replace(command, time=stamps, velocity=differenced)
    found = worlds.trials([replace(recording, command=late)])[0].motion.command
    assert found is not None and found.velocity is not None
    true = np.gradient(command.position, command.time, axis=0)
    size = np.abs(true).max()
    assert np.abs(differenced - true).max() > 0.02 * size
    nearest = np.clip(np.round((found.time - command.time[0]) / step).astype(int), 0, len(true) - 1)
    assert np.abs(found.velocity - true[nearest]).max() < 0.01 * size


def test_a_command_without_a_speed_is_given_none():
    """Goals of a position servo: a damper that is told no speed would be told one, unless a torque tells."""
    recording = worlds.world(3, "B")[0]
    assert recording.command is not None
    goals = replace(recording.command, velocity=None)
    silent = replace(recording, command=goals, commanded_effort=None)
    found = worlds.trials([silent])[0].motion.command
    assert found is not None and found.velocity is not None
    assert not np.any(found.velocity)
