"""Zero-phase filters and a new even rate."""

from __future__ import annotations

import numpy as np
from scipy.signal import butter, sosfiltfilt

from samrl_core.common.errors import InputError
from samrl_ros.log_import.specs import Filter, Resample

_EVEN = 0.02  # relative jitter of the steps up to which a filter takes them as even
_LEAST = 30  # samples a filter needs
_GAP_STEPS = 5.0  # typical steps without a sample, beyond which nothing is known between two
_USUAL = 0.95  # of the steps, which are no gaps
_GAP_S = 0.2  # likewise; what is slower than 5 Hz is no motion that can be interpolated


def even(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, bool]:
    """Values at even steps (median step, linear between samples); whether they were not before."""
    steps = np.diff(time)
    step = float(np.median(steps))
    if np.abs(steps - step).max() <= _EVEN * step:
        return time, values, False
    grid = time[0] + step * np.arange(int(np.floor((time[-1] - time[0]) / step + 1e-6)) + 1)
    return grid, _interpolate(grid, time, values), True


def find_gaps(stamps: np.ndarray) -> np.ndarray:
    """Mask (M - 1,) of the steps between increasing stamps (M,) within which nothing is known."""
    steps = np.diff(stamps)
    return steps > max(_GAP_STEPS * float(np.median(steps)), _GAP_S)


def are_between(time: np.ndarray, stamps: np.ndarray, splined: bool = False) -> np.ndarray:
    """Mask (N,) of times within increasing stamps (M,), and in none of their gaps.

    A spline carries the noise of the stamps beside a gap into it, the farther the more: what is to be splined
    has gaps of five of the longer usual steps (stamps may come in bursts), however short these are.
    """
    if len(stamps) < 2:
        return np.isin(time, stamps)
    after = np.clip(np.searchsorted(stamps, time), 1, len(stamps) - 1)
    inside = (time >= stamps[0]) & (time <= stamps[-1])
    gaps = find_gaps(stamps)
    if splined:
        steps = np.diff(stamps)
        gaps |= steps > _GAP_STEPS * float(np.quantile(steps, _USUAL))
    return inside & (~gaps[after - 1] | np.isin(time, stamps))


def low_pass(time: np.ndarray, values: np.ndarray, smoothing: Filter, where: str) -> np.ndarray:
    """Forwards and backwards, so without phase.

    Args:
        time: even [s].
        values: (N, J).
        smoothing: order and cutoff.
        where: key path, for messages.

    Raises:
        InputError: cutoff at or above half the rate, or too few samples.
    """
    rate = 1.0 / float(np.median(np.diff(time)))
    if smoothing.cutoff_hz >= 0.5 * rate:
        raise InputError(
            f"{where}: cutoff {smoothing.cutoff_hz} Hz must be below half the recorded rate {rate:.5g} Hz"
        )
    if len(time) < _LEAST:
        raise InputError(f"{where}: {len(time)} samples are too few to filter, needed are {_LEAST}")
    sections = butter(smoothing.order, smoothing.cutoff_hz, fs=rate, output="sos")
    # The filter rings for about a period of its cutoff; the padding lets it settle before the first sample.
    padding = min(len(time) - 1, int(3 * rate / smoothing.cutoff_hz) + 3)
    return np.asarray(sosfiltfilt(sections, values, axis=0, padlen=padding))


def resample(
    time: np.ndarray, values: dict[str, np.ndarray], plan: Resample, where: str
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Filter, then take even samples; as recorded where neither is asked for."""
    if plan.filter is not None and values:
        smoothed, grid = {}, time
        for name, array in values.items():
            grid, on_grid, _ = even(time, array)
            smoothed[name] = low_pass(grid, on_grid, plan.filter, where)
        time, values = grid, smoothed
    if plan.rate_hz is None:
        return time, values
    count = int(np.floor((time[-1] - time[0]) * plan.rate_hz + 1e-6)) + 1
    grid = time[0] + np.arange(count) / plan.rate_hz
    return grid, {name: _interpolate(grid, time, array) for name, array in values.items()}


def _interpolate(grid: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.column_stack([np.interp(grid, time, column) for column in values.T])
