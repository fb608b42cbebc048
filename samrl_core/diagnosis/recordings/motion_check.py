"""Does the arm move in a recording?"""

from __future__ import annotations

import numpy as np

from samrl_core.cell.types.arm_recording import ArmRecording

LEAST_RANGE = 5e-4  # [rad or m] ASSUMPTION: below it, quantisation and noise are all there is
_SMOOTHING_S = 0.05


def smooth(time: np.ndarray, values: np.ndarray, window_s: float = _SMOOTHING_S) -> np.ndarray:
    """Moving average (N, J) over about `window_s`, without phase; shorter at the ends."""
    half = round(0.5 * window_s / max(typical_step(time), 1e-9))
    if half == 0:
        return values
    sums = np.vstack([np.zeros((1, values.shape[1])), np.cumsum(values - values[0], axis=0)])
    n = np.arange(len(values))
    low, high = np.maximum(n - half, 0), np.minimum(n + half + 1, len(values))
    return values[0] + (sums[high] - sums[low]) / (high - low)[:, None]


def typical_step(time: np.ndarray) -> float:
    """Median step [s] of the samples; those that nearly repeat a stamp do not count."""
    steps = np.diff(time)
    return float(np.median(steps[steps >= 1e-3 * np.quantile(steps, 0.9)]))


def derivative(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Smoothed time derivative (N, J) at the samples.

    Taken on even steps: between two stamps that nearly repeat, noise over next to no time is no velocity.
    """
    step = typical_step(time)
    count = int(np.clip((time[-1] - time[0]) / max(step, 1e-9), 2, 4 * len(time)))
    grid = np.linspace(time[0], time[-1], count + 1)
    even = np.column_stack([np.interp(grid, time, column) for column in values.T])
    derivative = smooth(grid, np.gradient(even, grid, axis=0))
    return np.column_stack([np.interp(time, grid, column) for column in derivative.T])


def ranges(recording: ArmRecording) -> np.ndarray:
    """(J,) range of the smoothed position [rad or m]."""
    position = recording.states.position
    assert position is not None  # the states of a recording always carry it
    return np.ptp(smooth(recording.states.time, position), axis=0)


def still_joints(recording: ArmRecording) -> tuple[str, ...]:
    """Joints that do not move: nothing can be said of their dynamics."""
    return tuple(j for j, r in zip(recording.arm.joints, ranges(recording), strict=True) if r < LEAST_RANGE)


def no_motion(recording: ArmRecording) -> str:
    """Why the recording shows no dynamics at all; empty if some joint moves."""
    largest = ranges(recording)
    if largest.max() >= LEAST_RANGE:
        return ""
    joint = recording.arm.joints[int(largest.argmax())]
    return (
        f"no joint moves: the largest range is {largest.max():.2g} of {joint}, motion starts at"
        f" {LEAST_RANGE} rad or m; record motion, `samrl excite` has programmes for it"
    )
