"""The low-pass that a driver put before a reading, told by the colour of the reading's noise.

A drive that reports its current filtered, as for display, leaves little noise at high frequencies and all of
it where motions are, and is late by the filter's time constant. Taken for white, such noise looks many times
smaller than it is, and all that lies in it like a cause.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import signal

BLOCK = 128  # samples of a spectrum; what happens in fewer than half of the blocks is not in their median
LEAST_BLOCKS = 8
ABOVE = 1.5  # times the band, from where on there is noise and no motion
LOWEST, HIGHEST = 0.1, 0.49  # of the rate: frequencies that are compared
LEAST_BINS = 12  # frequencies, to tell a slope
POLES = np.concatenate([[0.0], np.linspace(0.3, 0.98, 69)])
EXPLAINED = 0.25  # of the variance of the logarithm of the spectrum that a filter may leave
FITS = 0.1  # of it in all: another spectrum is not a first-order filter's
UNSURE = 4.0  # of the misfit's fall in chi-square, within which a weaker filter may be the true one


@dataclass(frozen=True)
class LowPass:
    """y[k] = pole y[k-1] + (1 - pole) x[k] at a rate [Hz]; the least that noise speaks for; 0: none."""

    pole: float
    rate: float

    @property
    def lag_s(self) -> float:
        """By how much it delays what is slow [s]."""
        return self.pole / (1.0 - self.pole) / self.rate

    def raised(self, band: float) -> float:
        """Factor from the noise that `white_noise` sees to white noise of as much power below `band` [Hz]."""
        return float(np.sqrt(self._mean(0.0, band) / np.exp(np.mean(np.log(self._power(*self._upper))))))

    def raised_detail(self, band: float) -> float:
        """The same from what `sample_detail` sees."""
        turn = np.linspace(0.0, np.pi, 512)
        seen = np.mean(self._power(0.0, 0.5 * self.rate) * (2.0 - 2.0 * np.cos(turn)) ** 2) / 6.0
        return float(np.sqrt(self._mean(0.0, band) / seen))

    @property
    def _upper(self) -> tuple[float, float]:
        return 0.25 * self.rate, 0.5 * self.rate

    def _mean(self, low: float, high: float) -> float:
        return float(np.mean(self._power(low, high)))

    def _power(self, low: float, high: float) -> np.ndarray:
        return spectrum(np.array(self.pole), np.linspace(low, high, 512) / self.rate)


def spectrum(pole: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Power of white noise of unit variance behind that low-pass, at shares of the rate."""
    return (1.0 - pole) ** 2 / (1.0 + pole**2 - 2.0 * pole * np.cos(2.0 * np.pi * share))


def find_low_pass(x: np.ndarray | None, rate: float, band: float) -> LowPass:
    """The filter behind which readings (F, J) were taken, by their noise above `band` [Hz].

    The spectrum's logarithm against a first-order filter's, each joint with a level of its own. It is a
    median over short blocks: steps of reversals have spectra of that kind too, and must not count.
    """
    none = LowPass(0.0, rate)
    if x is None or len(x) < LEAST_BLOCKS * BLOCK:
        return none
    frequency, power = signal.welch(x, fs=rate, nperseg=BLOCK, axis=0, detrend="linear", average="median")
    share = frequency / rate
    noise = (share > max(ABOVE * band / rate, LOWEST)) & (share < HIGHEST)
    tells = np.min(power[noise], axis=0, initial=np.inf) > 0.0
    if noise.sum() < LEAST_BINS or not tells.any():
        return none
    seen = np.log(power[noise][:, tells])
    expected = np.log(spectrum(POLES[:, None], share[noise]))
    off = seen - expected[:, :, None]
    misfit = np.mean((off - off.mean(axis=1, keepdims=True)) ** 2, axis=(1, 2))
    best = float(misfit.min())
    if best > FITS or best > EXPLAINED * misfit[0]:
        return none
    weakest = POLES[misfit < best * (1.0 + UNSURE / seen.size)][0]
    return LowPass(float(weakest), rate)
