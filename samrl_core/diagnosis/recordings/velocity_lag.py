"""Velocities that a driver filtered from the positions show it by their lag.

A lag of 3 ms leaves the inertia's torque 3 ms late and friction's sign wrong at every reversal; and what the
filter leaves of the noise above it says nothing of that below. The positions have all that such a velocity
was made of, so equations of motion take their derivative. A law may damp the filtered velocity all the same:
see `residuals.law_velocity`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import signal

from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal

COMPARED_HZ = 10.0  # content of motions, in which a low-pass is a delay
RATES = 8.0  # of a log, to the highest frequency that is compared
BLOCKS = 10  # stretches of a recording, each with a lag of its own
SURE = 5.0  # standard errors beyond zero
LEAST_S = 1.25e-3  # a filter of 127 Hz; differences of a 1 kHz loop are behind by a period of it at most
LEAST_PERIODS = 0.6  # of the log: a difference that looks back is half a period behind


def velocity_lag(states: JointSignal) -> float:
    """Delay [s] of the velocities behind the positions, one for all joints; 0 where none is certain.

    v(t) = dq(t - tau) = dq - tau ddq within the moving band, with the logged velocity's own differences as
    instrument: their noise is not that of the positions, so that white noise of either does not bias tau
    (instrumental variables; Soderstrom 2007). Joints share a driver, and count as well as they tell.
    """
    if states.position is None or states.velocity is None or len(states) < 3:
        return 0.0
    period = float(np.median(np.diff(states.time)))
    band = min(COMPARED_HZ, 1.0 / (period * RATES))
    edge = round(1.0 / (period * band))  # of a filter that starts
    if len(states) < 4 * edge + 8 * BLOCKS:
        return 0.0
    low = signal.butter(4, band, fs=1.0 / period, output="sos")
    q, v = (signal.sosfiltfilt(low, x, axis=0) for x in (states.position, states.velocity))
    speed = np.gradient(q, period, axis=0)
    instrument, growth = (np.gradient(x, period, axis=0)[edge:-edge] for x in (v, speed))
    products, squares = _sums(instrument * (speed - v)[edge:-edge]), _sums(instrument * growth)
    tells = squares.sum(axis=0) > 0.0
    if not tells.any():
        return 0.0
    products, squares = products[:, tells], squares[:, tells]
    whole = squares.sum(axis=0)
    lag = products.sum(axis=0) / whole
    # Where only some blocks move, only those tell.
    error = np.sqrt(np.sum((products - lag * squares) ** 2, axis=0)) / whole
    weight = 1.0 / np.maximum(error, 1e-9) ** 2
    shared, deviation = float(np.sum(weight * lag) / np.sum(weight)), float(np.sum(weight) ** -0.5)
    # Joints that disagree make the shared lag as uncertain as they are apart.
    deviation *= max(1.0, float(np.sqrt(np.mean(weight * (lag - shared) ** 2))))
    return shared if shared > SURE * deviation else 0.0


def is_filtered(states: JointSignal) -> bool:
    """Whether velocities are so late that a filter stands between them and the positions, for sure."""
    return velocity_lag(states) > max(LEAST_S, LEAST_PERIODS * float(np.median(np.diff(states.time))))


def set_apart(recordings: Sequence[ArmRecording]) -> tuple[list[ArmRecording], float]:
    """Recordings with late velocities apart, as no motion's, and how late [s] they are; 0 where none is.

    One arm has one driver: all velocities go where any is late for sure.
    """
    lags = [velocity_lag(r.states) for r in recordings if is_filtered(r.states)]
    if not lags:
        return list(recordings), 0.0
    apart = [replace(r.states, velocity=None, filtered_velocity=r.states.velocity) for r in recordings]
    found = [replace(r, states=states) for r, states in zip(recordings, apart, strict=True)]
    return found, float(np.median(lags))


def _sums(x: np.ndarray) -> np.ndarray:
    """(BLOCKS, J) of (F, J)."""
    return np.array([part.sum(axis=0) for part in np.array_split(x, BLOCKS)])
