"""A filter of first order on a command acts at its own period, however slow the log is."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.diagnosis.residuals.basis_functions import low_passed

CUTOFF_HZ, SINE_HZ, RATE_HZ = 6.0, 1.5, 125.0


def filtered(ticks: int) -> float:
    """Largest error of a filtered sine of a log at 125 Hz, against the filter that runs all the time."""
    time = np.arange(0.0, 6.0, 1.0 / RATE_HZ)
    out = low_passed(np.sin(2 * np.pi * SINE_HZ * time), CUTOFF_HZ, RATE_HZ, ticks)
    response = np.exp(2j * np.pi * SINE_HZ * time) / (1.0 + 1j * SINE_HZ / CUTOFF_HZ)
    return float(np.max(np.abs(out - np.imag(response))[len(time) // 2 :]))


def test_a_filter_between_samples_is_as_late_as_it_is() -> None:
    assert filtered(8) < 0.006
    assert filtered(1) > 0.03  # of samples alone it is half a sample less late


@pytest.mark.parametrize("ticks", [1, 4])
def test_what_rests_stays(ticks: int) -> None:
    """A constant passes from its first sample on, and a step ends where it leads."""
    step = np.where(np.arange(500) < 100, 0.7, 1.2)
    out = low_passed(step, CUTOFF_HZ, RATE_HZ, ticks)
    assert out[:100] == pytest.approx(0.7, abs=1e-12)
    assert out[-1] == pytest.approx(1.2, abs=1e-9)
    assert np.all(np.diff(out) >= -1e-12)
