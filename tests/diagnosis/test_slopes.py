"""Slopes of samples at whatever times, and how much of their rounding is in them."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.diagnosis.residuals.signals.slopes import find_slopes


@pytest.mark.parametrize("step", [0.001, 0.002, 0.01])
def test_the_slope_of_a_swing_within_the_band_is_its_own(step: float) -> None:
    time, turn = np.arange(0.0, 1.0, step), 2 * np.pi * 5.0
    found, own = find_slopes(time, np.sin(turn * time)[:, None])[:, 0], turn * np.cos(turn * time)
    assert found[3:-3] == pytest.approx(own[3:-3], abs=0.02 * turn)


def test_its_ends_have_no_slope_of_a_sample_that_stands_for_others() -> None:
    time = np.arange(0.0, 1.0, 0.001)
    found = find_slopes(time, np.sin(10.0 * time)[:, None])[:, 0]
    assert found == pytest.approx(10.0 * np.cos(10.0 * time), abs=0.001)


def test_rows_that_lack_bend_no_slope() -> None:
    time = np.flatnonzero(np.random.default_rng(1).uniform(size=1000) < 0.5) * 0.001
    found = find_slopes(time, (time**3)[:, None])[:, 0]
    assert found == pytest.approx(3 * time**2, abs=1e-9)


def test_rounding_makes_less_than_half_of_the_noise_of_differences() -> None:
    time = np.arange(4000) * 0.001
    goal = np.sin(time)[:, None]
    found = find_slopes(time, np.round(goal, 4)) - np.cos(time)[:, None]
    differences = np.gradient(np.round(goal, 4), time, axis=0) - np.cos(time)[:, None]
    assert np.std(found) < 0.45 * np.std(differences)


def test_fewer_samples_than_a_window_have_differences() -> None:
    assert find_slopes(np.arange(4) * 0.001, np.arange(4.0)[:, None])[:, 0] == pytest.approx(1000.0)
