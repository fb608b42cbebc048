"""Phases of a motion: rest, slow, fast, and around reversals."""

from __future__ import annotations

import numpy as np

REST_SPEED = 0.01  # [rad/s or m/s]
SLOW_SPEED = 0.15  # likewise
REVERSAL_S = 0.15  # around a change of direction
REST, REVERSAL, SLOW, FAST = range(4)  # as in `result.PHASES`


def phases_of_speed(speed: np.ndarray, rest: float = REST_SPEED, slow: float = SLOW_SPEED) -> np.ndarray:
    """Phase of each sample by speed alone."""
    return np.where(speed < rest, REST, np.where(speed < slow, SLOW, FAST))


def phases_of_motion(velocity: np.ndarray, dt: float) -> np.ndarray:
    """Phase (N, J) of each sample of velocities (N, J) [rad/s] that are `dt` [s] apart."""
    speed = np.abs(velocity)
    out = phases_of_speed(speed)
    reach = max(1, round(REVERSAL_S / dt))
    for j in range(velocity.shape[1]):
        moving = np.flatnonzero(speed[:, j] > REST_SPEED)
        turns = np.flatnonzero(np.diff(np.sign(velocity[moving, j])))
        for k in turns:
            first, last = moving[k], moving[k + 1]
            if (last - first) * dt < 1.0:  # a long rest in between is no reversal
                out[max(0, first - reach) : last + reach, j] = REVERSAL
    return out
