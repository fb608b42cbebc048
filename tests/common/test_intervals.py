"""Intervals against values worked out by hand and by simulation."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.common.statistics import bootstrap_interval, fisher_p, mcnemar_p, pooled_median


def test_bootstrap_of_a_mean_is_about_two_standard_errors_wide() -> None:
    rng = np.random.default_rng(1)
    samples = list(rng.standard_normal(400))
    low, high = bootstrap_interval(samples, lambda some: float(np.mean(some)), rng)
    error = float(np.std(samples)) / 20.0
    assert low == pytest.approx(np.mean(samples) - 1.96 * error, abs=0.3 * error)
    assert high == pytest.approx(np.mean(samples) + 1.96 * error, abs=0.3 * error)


def test_fisher_of_a_small_table() -> None:
    # 3 of 3 against 0 of 3: one of C(6, 3) = 20 tables.
    assert fisher_p(3, 3, 0, 3) == pytest.approx(0.05)
    assert fisher_p(2, 4, 2, 4) > 0.5


def test_pairs_that_agree_say_nothing() -> None:
    assert mcnemar_p([True, False], [True, False]) == 1.0
    assert mcnemar_p([True] * 5, [False] * 5) == pytest.approx(0.5**5)


def test_a_pooled_median_draws_episodes_as_a_whole() -> None:
    """Many equal values of one episode say no more than one does."""
    rng = np.random.default_rng(3)
    middle, (low, high) = pooled_median({4: [1.0] * 50, 7: [3.0] * 50, 9: []}, rng)
    assert middle == 2.0 and (low, high) == (1.0, 3.0)
    assert np.isnan(pooled_median({2: [], 3: []}, rng)[0])
