"""The spectrum of all blocks at once is SciPy's, which takes one after the other."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from samrl_core.diagnosis.residuals.signals import spectrum
from samrl_core.diagnosis.residuals.signals.spectrum import detrended_spectrum


@pytest.mark.parametrize("by_median", [False, True])
@pytest.mark.parametrize("length", [64, 65])
@pytest.mark.parametrize("samples", [40, 65, 1000, 1001])
def test_it_is_scipys(monkeypatch: pytest.MonkeyPatch, samples: int, length: int, by_median: bool) -> None:
    monkeypatch.setattr(spectrum, "BLOCKS_AT_ONCE", 4)
    x = np.random.default_rng(3).normal(size=(samples, 3)).cumsum(axis=0)
    average = "median" if by_median else "mean"
    expected = signal.welch(
        x, fs=250.0, nperseg=min(samples, length), axis=0, detrend="linear", average=average
    )
    for found, one in zip(detrended_spectrum(x, 250.0, length, by_median), expected, strict=True):
        # Without its trend a signal has nothing at frequency zero but rounding.
        np.testing.assert_allclose(found, one, rtol=1e-9, atol=1e-18)
