"""Gaps of an arm's stamps over which no spline tells where it was."""

from __future__ import annotations

import numpy as np

from samrl_ros.log_import.resampling import are_between


def test_a_spline_is_not_led_over_a_gap_of_many_short_steps() -> None:
    """At 120 Hz, 0.15 s are eighteen steps: the noise of two stamps was carried nine of them far."""
    stamps = np.arange(0.0, 10.0, 1 / 120)
    stamps = stamps[(stamps < 4.0) | (stamps > 4.15)]
    seen = np.array([2.0, 4.02, 4.1, 7.0])
    assert are_between(seen, stamps, splined=True).tolist() == [True, False, False, True]
    assert are_between(seen, stamps).all()


def test_stamps_that_come_in_bursts_have_no_gaps_between() -> None:
    """A driver that hands on ten readings at once."""
    stamps = np.sort(np.concatenate([np.arange(0.0, 5.0, 0.02) + 2e-4 * k for k in range(10)]))
    assert are_between(np.arange(0.1, 4.9, 0.013), stamps, splined=True).all()
