"""Encoders and torque sensors: three families.

Sources: Hanselmann 1990 (errors of resolvers, two harmonics); IEEE Std 952 (a bias that wanders: Gauss-
Markov process).
"""

from __future__ import annotations

import math

import numpy as np
from scipy.signal import lfilter

from samrl_core.blind_test.disturbances.disturbance import (
    Disturbance,
    Injection,
    Quantity,
    Site,
    log_quantile,
    quantile,
)
from samrl_core.blind_test.engines.hooks import Hooks
from samrl_core.blind_test.second_set.sizes import between, either_sign

Reading = tuple[np.ndarray, np.ndarray]


def _offset(site: Site, form: str, severity: float) -> Injection:
    """A zero that is off: there is one formula."""
    error = np.zeros(len(site.armature))
    error[site.joint] = either_sign(site) * log_quantile(severity, 0.001, 0.04)

    def read(t: float, q: np.ndarray, v: np.ndarray) -> Reading:
        return q + error, v

    parameters = {"e": Quantity(float(error[site.joint]), "rad")}
    return Injection(parameters, lambda hooks, rng: hooks.encoder.append(read))


def _eccentricity(site: Site, form: str, severity: float) -> Injection:
    """Two harmonics of a pole pitch, and a velocity that is differenced from the same reading."""
    size = log_quantile(severity, 0.0002, 0.003)
    order, joint = float(site.rng.integers(16, 65)), site.joint
    phi, second = between(site, -math.pi, math.pi), between(site, -math.pi, math.pi)

    def read(t: float, q: np.ndarray, v: np.ndarray) -> Reading:
        angle = order * q[joint]
        q, v = q.copy(), v.copy()
        q[joint] += size * (math.sin(angle + phi) + 0.35 * math.sin(2 * angle + second))
        slope = order * (math.cos(angle + phi) + 0.7 * math.cos(2 * angle + second))
        v[joint] *= 1.0 + size * slope
        return q, v

    parameters = {
        "a": Quantity(size, "rad"),
        "harmonic": Quantity(order, "1/rad"),
        "phi": Quantity(phi, "rad"),
    }
    return Injection(parameters, lambda hooks, rng: hooks.encoder.append(read))


def _torque_sensor(site: Site, form: str, severity: float) -> Injection:
    """A gain, and a bias that wanders about its mean with a correlation time of some seconds."""
    effort = float(site.spec.limits.effort[site.joint])
    gain = either_sign(site) * quantile(severity, 0.01, 0.08)
    bias = either_sign(site) * quantile(severity, 0.012, 0.05) * effort
    wander, seconds, joint = 0.25 * abs(bias), between(site, 2.0, 6.0), site.joint

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        def sense(time: np.ndarray, reading: np.ndarray) -> np.ndarray:
            keep = math.exp(-float(time[1] - time[0]) / seconds)
            kicks = rng.normal(size=len(time)) * wander * math.sqrt(1.0 - keep**2)
            kicks[0] = wander * rng.normal()
            out = reading.copy()
            out[:, joint] = (1.0 + gain) * reading[:, joint] + bias + lfilter([1.0], [1.0, -keep], kicks)
            return out

        hooks.sensor.append(sense)

    parameters = {
        "g": Quantity(gain, "1"),
        "b": Quantity(bias, "N m"),
        "wander": Quantity(wander, "N m"),
        "correlation": Quantity(seconds, "s"),
    }
    return Injection(parameters, attach)


FAMILIES = (
    Disturbance("encoder_offset", "joint", _offset, "link", first_joint=1),
    Disturbance("encoder_eccentricity", "joint", _eccentricity, "encoder"),
    Disturbance("torque_sensor_error", "joint", _torque_sensor, "drive"),
)
