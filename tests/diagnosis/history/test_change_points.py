"""Steps in series of known make: found where they are, and not where none is."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.diagnosis.history.change_points import CHANCE, LEAST, change_points


def series(seed: int, levels: list[float], days: int, std: float, scatter: float = 0.0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    means = np.repeat(levels, days)
    return means + rng.normal(0, std, len(means)) + rng.normal(0, scatter, len(means))


@pytest.mark.parametrize("scatter", [0.0, 0.3])
def test_level_series_have_no_step(scatter: float) -> None:
    false = 0
    for seed in range(300):
        values = series(seed, [2.0], 10, 0.1, scatter)
        false += bool(change_points(values, np.full(10, 0.1))[0])
    # The scatter is estimated from nine neighbours, so that a few more than the stated chance are false.
    assert false / 300 <= 5 * CHANCE


def test_a_step_is_found_at_its_place_with_its_size() -> None:
    for seed in range(20):
        steps, scatter = change_points(series(seed, [1.0, 2.0], 6, 0.1), np.full(12, 0.1))
        assert [s.index for s in steps] == [6]
        assert abs(steps[0].after - steps[0].before - 1.0) < 4 * steps[0].std < 0.5
        assert scatter < 0.2


def test_two_steps_are_both_found() -> None:
    steps, _ = change_points(series(3, [1.0, 3.0, 2.0], 6, 0.1), np.full(18, 0.1))
    assert [s.index for s in steps] == [6, 12]
    assert steps[0].after == steps[1].before


def test_a_wide_interval_does_not_make_a_step() -> None:
    values, std = np.array([1.0, 1.0, 1.1, 4.0, 1.0, 0.9]), np.array([0.1, 0.1, 0.1, 3.0, 0.1, 0.1])
    assert change_points(values, std)[0] == ()


def test_too_few_days_say_nothing() -> None:
    assert change_points(np.array([0.0, 0.0, 9.0])[: LEAST - 1], np.full(3, 0.1)) == ((), 0.0)


def test_exact_values_without_any_width_are_compared_too() -> None:
    steps, _ = change_points(np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0]), np.zeros(6))
    assert [s.index for s in steps] == [3]
