"""The filter without phase gives what SciPy's gives."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from samrl_core.diagnosis.residuals.signals.zero_phase import ZeroPhaseFilter


@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("shape", [(60,), (1500,), (1500, 7), (40, 3, 2)])
def test_it_is_scipys_to_the_bit(order: int, shape: tuple[int, ...]) -> None:
    sections = signal.butter(order, 0.05, output="sos")
    x = np.random.default_rng(order).standard_normal(shape).cumsum(axis=0)
    found = ZeroPhaseFilter(sections)(x)
    np.testing.assert_array_equal(found, signal.sosfiltfilt(sections, x, axis=0))


def test_a_signal_as_short_as_its_mirror_is_refused() -> None:
    filtered = ZeroPhaseFilter(signal.butter(3, 0.05, output="sos"))
    filtered(np.zeros(filtered.edge + 1))
    with pytest.raises(ValueError, match=f"{filtered.edge} samples is too short"):
        filtered(np.zeros(filtered.edge))


def test_it_changes_nothing_of_what_it_filters() -> None:
    x = np.arange(100.0)
    ZeroPhaseFilter(signal.butter(3, 0.05, output="sos"))(x)
    np.testing.assert_array_equal(x, np.arange(100.0))
