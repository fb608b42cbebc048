"""A slope common to several series, with an interval that holds for values that are alike in time."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.common.trend import common_trend


def noise(rng: np.random.Generator, count: int, alike: float) -> np.ndarray:
    """A stationary series whose neighbours correlate by `alike`, standard deviation 1."""
    values = np.empty(count)
    values[0] = rng.normal()
    for k in range(1, count):
        values[k] = alike * values[k - 1] + np.sqrt(1.0 - alike**2) * rng.normal()
    return values


def test_a_slope_is_found_across_levels() -> None:
    times = np.arange(10.0)
    found = common_trend([(times, 3.0 * times + level) for level in (0.0, 100.0)])
    assert found is not None and found.slope == pytest.approx(3.0) and not found.includes_zero
    assert found.ci95 == pytest.approx((3.0, 3.0))


@pytest.mark.parametrize("alike", [0.0, 0.7])
def test_the_interval_holds_the_slope_as_often_as_it_says(alike: float) -> None:
    """Of 400 draws; the plain interval holds it in 63 % where neighbours correlate by 0.7."""
    rng = np.random.default_rng(3)
    times = np.arange(80.0)
    held = 0
    for _ in range(400):
        found = common_trend([(times, 0.1 * times + level + noise(rng, 80, alike)) for level in (0.0, 5.0)])
        assert found is not None
        held += found.ci95[0] <= 0.1 <= found.ci95[1]
    assert 0.91 <= held / 400 <= 0.99


def test_a_slope_in_noise_is_told_from_none() -> None:
    rng = np.random.default_rng(4)
    times = np.arange(60.0)
    level = common_trend([(times, noise(rng, 60, 0.7))])
    growing = common_trend([(times, 0.2 * times + noise(rng, 60, 0.3))])
    assert level is not None and level.includes_zero and level.effective < level.values == 60
    assert growing is not None and not growing.includes_zero


def test_too_little_says_nothing() -> None:
    assert common_trend([]) is None
    assert common_trend([(np.array([1.0]), np.array([2.0]))]) is None
    few = common_trend([(np.array([1.0, 2.0]), np.array([2.0, 5.0]))])
    assert few is not None and few.ci95 == (-np.inf, np.inf)
