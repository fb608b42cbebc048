"""Joint motions as sampled signals whose position, velocity and acceleration agree with each other."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.common.errors import InputError


def sample_times(duration_s: float, period_s: float) -> np.ndarray:
    """Stamps (N,) [s] from 0 to `duration_s` at the controller period.

    Raises:
        InputError: a length that is not positive, or shorter than 1 s.
    """
    if not (np.isfinite(period_s) and 0.0 < period_s <= 0.02):
        raise InputError(f"period is {period_s} s, must be above 0 and at most 0.02 s")
    if not (np.isfinite(duration_s) and 1.0 <= duration_s <= 3600.0):
        raise InputError(f"trajectory lasts {duration_s} s, must be 1 to 3600 s")
    return np.arange(round(duration_s / period_s) + 1) * period_s


def closing_rest(duration_s: float) -> float:
    """Rest after a motion [s]: time for a softly held arm to swing out, a twentieth of it at most."""
    return float(np.clip(0.05 * duration_s, 0.1, 0.6))


def from_velocity(time: np.ndarray, velocity: np.ndarray, start: np.ndarray) -> JointSignal:
    """The motion with this velocity (N, J) from `start` (J,) [rad]; feed-forward torque zero.

    Position by the trapezoidal rule, so that a guard that compares position steps with velocities finds
    them consistent to rounding.
    """
    dt = float(time[1] - time[0])
    steps = 0.5 * dt * (velocity[1:] + velocity[:-1])
    position = start + np.concatenate([np.zeros((1, velocity.shape[1])), np.cumsum(steps, axis=0)])
    acceleration = np.gradient(velocity, dt, axis=0)
    return JointSignal(time, position, velocity, acceleration, np.zeros_like(velocity))


def rounded(velocity: np.ndarray, dt: float, window_s: float) -> np.ndarray:
    """Piecewise constant velocity (N, J) with its corners rounded over `window_s` by a raised cosine.

    A corner of height v becomes a ramp whose acceleration is at most 2 v / window_s.
    """
    count = max(3, round(window_s / dt))
    window = np.hanning(count + 2)[1:-1]
    window /= window.sum()
    before = (len(window) - 1) // 2
    padded = np.pad(velocity, ((before, len(window) - 1 - before), (0, 0)), mode="edge")
    return np.stack([np.convolve(column, window, mode="valid") for column in padded.T], axis=1)


def minimum_jerk_velocity(time: np.ndarray, begin: float, length: float, way: np.ndarray) -> np.ndarray:
    """Velocity (N, J) of a minimum-jerk move by `way` (J,) [rad] within [begin, begin + length] [s].

    Flash and Hogan 1985: 30 (s^2 - 2 s^3 + s^4) / length; peak 1.875 way / length, zero outside.
    """
    s = np.clip((time - begin) / length, 0.0, 1.0)
    return np.outer(30.0 * (s * (1.0 - s)) ** 2 / length, way)


def minimum_jerk_length(way: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> float:
    """Shortest move by `way` (J,) [rad] within bounds on velocity and acceleration (J,) [s].

    Peaks of the minimum-jerk move: velocity 15/8 way / T, acceleration 10 / sqrt(3) way / T^2.
    """
    distance = np.abs(way)
    by_velocity = 1.875 * distance / velocity
    by_acceleration = np.sqrt(10.0 / np.sqrt(3.0) * distance / acceleration)
    return float(max(by_velocity.max(), by_acceleration.max()))


def taper(time: np.ndarray, begin: float, end: float, ramp_s: float) -> np.ndarray:
    """Weight (N,): 0 outside [begin, end] [s], 1 inside, raised-cosine ramps of `ramp_s` within."""
    rise = np.clip((time - begin) / ramp_s, 0.0, 1.0)
    fall = np.clip((end - time) / ramp_s, 0.0, 1.0)
    return 0.25 * (1.0 - np.cos(np.pi * rise)) * (1.0 - np.cos(np.pi * fall))
