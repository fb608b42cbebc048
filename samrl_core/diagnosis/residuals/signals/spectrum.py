"""The spectrum of a signal without its trends, of all blocks at once."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy import signal

BLOCKS_AT_ONCE = 1024  # a log of an hour is not held three times in memory


def detrended_spectrum(
    x: np.ndarray, rate: float, length: int, by_median: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (B,) [Hz] and power (B, J) per hertz of a signal (F, J), over blocks (Welch).

    As `scipy.signal.welch` with `detrend="linear"`, Hann window and blocks half over each other, in a third
    of its time: it takes the trend of one block after the other.

    Args:
        rate: of the signal [Hz].
        length: samples of a block; all of them where the signal has fewer.
        by_median: what happens in fewer than half of the blocks does not count.
    """
    length = min(length, len(x))
    blocks = sliding_window_view(x, length, axis=0)[:: length - length // 2]  # (K, J, length)
    powers = []
    for k in range(0, len(blocks), BLOCKS_AT_ONCE):
        level = signal.detrend(blocks[k : k + BLOCKS_AT_ONCE])
        frequency, power = signal.periodogram(level, fs=rate, window="hann", detrend=False)
        powers.append(power)
    power = np.concatenate(powers)
    if by_median:
        return frequency, np.median(power, axis=0).T / _median_of_mean(len(power))
    return frequency, power.mean(axis=0).T


def _median_of_mean(blocks: int) -> float:
    """The median of so many squared amplitudes over their mean (Allen et al. 2012, appendix B)."""
    even = 2.0 * np.arange(1, (blocks - 1) // 2 + 1)
    return 1.0 + float(np.sum(1.0 / (even + 1.0) - 1.0 / even))
