from __future__ import annotations

import numpy as np
import pytest

from samrl_core.common.statistics import (
    Share,
    auroc,
    brier_score,
    expected_calibration_error,
    rejected_share,
    risk_coverage,
    summarise_values,
    wilson_interval,
)


def test_wilson_agrees_with_values_worked_out_by_hand() -> None:
    # 8 of 10: centre (0.8 + 3.8415/20) / 1.38415 = 0.71675, half 1.96/1.38415 sqrt(.016 + .0096036) = 0.22658
    low, high = wilson_interval(8, 10)
    assert low == pytest.approx(0.4902, abs=1e-4)
    assert high == pytest.approx(0.9433, abs=1e-4)
    # none of 200: upper bound z2 / (n + z2)
    assert wilson_interval(0, 200) == (0.0, pytest.approx(3.8415 / 203.8415, abs=1e-5))
    assert wilson_interval(5, 5)[1] == 1.0
    assert wilson_interval(0, 0) == (0.0, 1.0)


def test_share_without_cases_has_no_value() -> None:
    assert Share.of([]).value is None
    assert Share.of([True, False, False, True]).value == 0.5


def test_auroc_counts_ties_half() -> None:
    # pairs: 3>1, 3>2, 2>1 win, 2=2 ties: (3 + 0.5) / 4
    assert auroc([3, 2], [1, 2]) == pytest.approx(3.5 / 4)
    assert auroc([1, 1], [1, 1]) == 0.5
    assert auroc([], [1.0]) is None


def test_rejection_at_a_share_of_known() -> None:
    known = list(range(100))  # five of them lie above 94
    assert rejected_share([94, 95, 200], known).successes == 2
    assert rejected_share([8, 9, 10], range(10)).successes == 1  # of ten none may be refused: above 9
    assert rejected_share([1.0], []).value is None


def test_calibration_error_by_hand() -> None:
    # bin 0.9: two stated .95, one right: |.95 - .5| = .45, weight 2/4
    # bin 0.2: two stated .25, none right: .25, weight 2/4
    error = expected_calibration_error([0.95, 0.95, 0.25, 0.25], [True, False, False, False])
    assert error == pytest.approx(0.5 * 0.45 + 0.5 * 0.25)
    assert expected_calibration_error([1.0], [True]) == 0.0
    assert brier_score([0.9, 0.2], [True, False]) == pytest.approx((0.01 + 0.04) / 2)


def test_risk_coverage_keeps_unanswered_cases_in_the_denominator() -> None:
    curve = risk_coverage([0.2, 0.9, 0.5], [False, True, False], cases=6)
    assert curve == [(1 / 6, 0.0), (2 / 6, 0.5), (3 / 6, pytest.approx(2 / 3))]


def test_summary_brackets_its_median() -> None:
    s = summarise_values([1.0, 2.0, 3.0, np.inf], np.random.default_rng(0))
    assert s["n"] == 3
    assert s["median"] == 2.0
    assert s["median_ci95"] == [1.0, 3.0]
