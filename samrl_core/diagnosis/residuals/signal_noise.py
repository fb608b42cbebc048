"""What readings are worth: their clock, their steps, their white noise, and what stands out of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import signal

from samrl_core.cell.types.arm_recording import JointSignal

DIFFERENCED = 1e-6  # of the largest velocity: rounding of what is the same
SURE_SPAN_S = 2.0  # of the spectra that tell a motion from noise
STANDS_OUT = 6.0  # times the power of noise: chance does not reach it in a spectrum of a few averages


@dataclass(frozen=True, eq=False)
class Noise:
    """White noise of the raw channels at full rate, from their content above the moving band; each (J,)."""

    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray
    commanded_effort: np.ndarray


def without_differences(states: JointSignal) -> JointSignal:
    """States without a velocity that somebody differenced from the positions: it is no reading of its own.

    Its noise is that of the positions, and rises with frequency where a tachometer's is white.
    """
    if states.position is None or states.velocity is None or len(states) < 3:
        return states
    difference = np.gradient(states.position, states.time, axis=0) - states.velocity
    same = np.abs(difference).max() <= DIFFERENCED * np.abs(states.velocity).max()
    return replace(states, velocity=None) if same else states


def regular(time: np.ndarray) -> np.ndarray:
    """Stamps freed of their jitter, where they belong to a regular clock; else as they are."""
    index = np.arange(len(time))
    period, start = np.polyfit(index, time, 1)
    fitted = start + period * index
    return fitted if float(np.max(np.abs(fitted - time))) < 0.45 * period else time


def quantum(position: np.ndarray) -> np.ndarray:
    """Step (J,) of the grid that readings (F, J) lie on; 0 where they lie on none."""
    out = np.zeros(position.shape[1])
    for j, steps in enumerate(np.abs(np.diff(position, axis=0)).T):
        some = steps[steps > 1e-9]
        if len(some) < 10:
            continue
        # A log's digits round the step too: what many steps make of it is finer than the smallest.
        step = float(np.min(some))
        for most in (5.0, 30.0, np.inf):
            few = some[some < (most + 0.5) * step]
            step = float(np.sum(few) / np.sum(np.round(few / step)))
        counts = some / step
        # A float's smallest difference is no grid: most steps would be thousands of it.
        if np.median(counts) < 1000.0 and np.all(np.abs(counts - np.round(counts)) < 0.02):
            out[j] = step
    return out


def highest_sure_frequency(x: np.ndarray, noise: np.ndarray, rate: float) -> np.ndarray:
    """Frequency (J,) [Hz] up to which readings (F, J) stand out of white noise (J,) of known deviation."""
    length = min(len(x), round(SURE_SPAN_S * rate))
    frequency, power = signal.welch(x, fs=rate, nperseg=length, axis=0, detrend="linear")
    above = power > STANDS_OUT * noise**2 * 2.0 / rate
    return np.array([frequency[column][-1] if column.any() else 0.0 for column in above.T])


def white_noise(x: np.ndarray, rate: float) -> np.ndarray:
    """Standard deviation (J,) of the white part of (F, J), from the spectrum's median in its upper half."""
    length = min(len(x), 512)
    frequency, power = signal.welch(x, fs=rate, nperseg=length, axis=0, detrend="linear")
    upper = frequency > 0.25 * rate
    # The median of a chi-square with 2 degrees of freedom per average is below its mean: 0.69 at worst.
    return np.sqrt(np.median(power[upper], axis=0) * rate / 2.0)
