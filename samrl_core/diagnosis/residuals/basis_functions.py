"""Functions of time that several effects share: smooth sign, bristle, play, limits, filters."""

from __future__ import annotations

import math

import numpy as np
from scipy import signal

SIGN_SPEEDS = (0.002, 0.006, 0.02)  # [rad/s] width of the smooth sign; simulators and real bearings differ


def smooth_sign(velocity: np.ndarray, width: float) -> np.ndarray:
    """tanh(velocity / width)."""
    return np.tanh(velocity / width)


def power_sign(velocity: np.ndarray, width: float, exponent: float) -> np.ndarray:
    """v / (width^p + |v|^p)^(1/p): nears one as 1 - (width / v)^p / p, an exponential one at once.

    p = 1 and p = 2 are the usual sigmoids of that name, an arctangent lies at 1.1 to 1.4, a tanh at 2.8.
    """
    return velocity / (width**exponent + np.abs(velocity) ** exponent) ** (1.0 / exponent)


def half_speed(width: float, exponent: float) -> float:
    """Speed at which `power_sign` is a half."""
    return float(width * (2.0**exponent - 1.0) ** (-1.0 / exponent))


def bristle(position: np.ndarray, distance: float) -> np.ndarray:
    """Normalised Dahl bristle (F,) in -1..1 along a position, relaxing over `distance` [same unit].

    dz = dq / distance (1 - z sgn dq), solved exactly for each step (Dahl 1968).
    """
    steps = np.diff(position, prepend=position[:1])
    decay = np.exp(-np.abs(steps) / distance).tolist()
    target = np.sign(steps).tolist()
    out, z = [], 0.0
    for d, s in zip(decay, target, strict=True):
        z = s + (z - s) * d
        out.append(z)
    return np.array(out)


def rubbing_spring(force: np.ndarray, level: float, yield_force: float) -> np.ndarray:
    """Twist (F,) under a force, times the spring's stiffness K, of a spring with a Dahl slider beside it.

    force = K x + level z(x), dz = dx K / yield_force (1 - z sgn dx): stiffer by 1 + level / yield_force after
    each turn, and soft as the spring alone once it slides (Tjahjowidodo 2013 with one element; Bouc 1967).
    """
    out, twist, z, last = [], float(force[0]), 0.0, float(force[0])
    for f in force.tolist():
        # steps well below the force over which the slider turns round
        count = int(4.0 * abs(f - last) / yield_force) + 1
        part, side = (f - last) / count, (1.0 if f > last else -1.0)
        for _ in range(count):
            step = part / (1.0 + level / yield_force * (1.0 - z * side))
            twist += step
            z = side + (z - side) * math.exp(-abs(step) / yield_force)
        out.append(twist)
        last = f
    return np.array(out)


def travel(velocity: np.ndarray, rate: float) -> np.ndarray:
    """Path (F,) along a velocity, sampled at `rate`.

    For bristles a better position than the encoder's: its noise alone turns a stiff bristle over, and a
    bristle has forgotten where it was long before an integral drifts.
    """
    return np.cumsum(velocity) / rate


def play(position: np.ndarray, half_width: float) -> np.ndarray:
    """Output (F,) of a play (backlash) operator of half width `half_width`, started in its middle."""
    out, y = [], float(position[0])
    for x in position.tolist():
        y = min(max(y, x - half_width), x + half_width)
        out.append(y)
    return np.array(out)


def rate_limited(x: np.ndarray, most: float) -> np.ndarray:
    """Signal (F,) that follows x by at most `most` per sample."""
    if np.all(np.abs(np.diff(x)) <= most):
        return x.copy()
    out, y = [], float(x[0])
    for value in x.tolist():
        y += min(max(value - y, -most), most)
        out.append(y)
    return np.array(out)


def low_passed(x: np.ndarray, cutoff: float, rate: float, ticks: int = 1) -> np.ndarray:
    """First-order causal low-pass (F, ...) by exact discretisation, started at rest on the first sample.

    A filter that runs `ticks` times per sample of the log has seen the signal on a straight line between the
    samples; one that only saw the samples would be half a sample less late.
    """
    a = np.exp(-2 * np.pi * cutoff / (rate * ticks))
    passed = a ** np.arange(ticks - 1, -1, -1) * (1 - a)  # of what each tick saw
    newest = float(passed @ (np.arange(1, ticks + 1) / ticks))
    kept = a**ticks
    start = np.expand_dims((1 - newest) * x[0], 0)
    out, _ = signal.lfilter([newest, 1 - kept - newest], [1, -kept], x, axis=0, zi=start)
    return np.asarray(out)


def resonant(x: np.ndarray, frequency: float, damping: float, dt: float) -> np.ndarray:
    """Response (N, ...) of a unit-gain second-order system, started in equilibrium with the first sample."""
    w = 2 * np.pi * frequency
    b, a = signal.bilinear([w * w], [1.0, 2 * damping * w, w * w], fs=1.0 / dt)
    return x[:1] + np.asarray(signal.lfilter(b, a, x - x[:1], axis=0))
