"""Six things no family of the contract stands for, on servo worlds."""

from __future__ import annotations

import math

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Quantity, quantile
from samrl_core.blind_test.servo_worlds.effects import Case, Make, Parameters
from samrl_core.blind_test.servo_worlds.engine import Machine


def _only(axis: int, count: int, value: float) -> list[float]:
    return [value if k == axis else 0.0 for k in range(count)]


def _paddle(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    """A paddle in a bath that sloshes: drag ~ |v - w| (v - w), the bath's own motion w dying slowly."""
    size = quantile(severity, 0.8, 3.0) * case.scales.torque[i] / case.scales.speed[i] ** 2
    bath = [0.0, 0.0]  # velocity, last time

    def push(t: float, q: list[float], v: list[float]) -> list[float]:
        dt, bath[1] = max(t - bath[1], 0.0), t
        bath[0] += dt / 0.6 * (0.8 * v[i] - bath[0])
        slip = v[i] - bath[0]
        return _only(i, len(q), -size * abs(slip) * slip)

    m.push.append(push)
    return {"drag": Quantity(size, "N m s2/rad2")}


def _shaken(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    """A neighbour's machine that shakes it all the time, at its own two frequencies."""
    size, n = quantile(severity, 0.08, 0.4), len(m.links)
    hertz, phase = case.span(0.6, 1.6), float(case.stream.uniform(-math.pi, math.pi))

    def push(t: float, q: list[float], v: list[float]) -> list[float]:
        wave = math.sin(2 * math.pi * hertz * t + phase) + 0.5 * math.sin(2 * math.pi * 2.7 * hertz * t)
        return [size * case.scales.torque[k] * wave for k in range(n)]

    m.push.append(push)
    return {"size": Quantity(size, "1"), "frequency": Quantity(hertz, "Hz")}


def _sag(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    """A weak supply: the more all axes draw, the less comes, 80 ms later."""
    size, drawn = quantile(severity, 0.1, 0.5), [0.0]
    period = float(m.drive["period_s"])

    def stage(t: float, out: list[float]) -> list[float]:
        now = sum(abs(x) / p for x, p in zip(out, case.peak, strict=True)) / len(out)
        drawn[0] += period / 0.08 * (now - drawn[0])
        return [x * (1.0 - size * min(drawn[0] * 1.5, 1.0)) for x in out]

    m.given.append(stage)
    return {"sag": Quantity(size, "1")}


def _grabs(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    """Something that catches now and then, for parts of a second."""
    size, width = quantile(severity, 0.1, 0.5) * case.rub(i), 0.02 * case.scales.speed[i]
    begins = 0.3 + np.cumsum(case.stream.uniform(0.4, 1.8, size=40))
    ends = begins + case.stream.uniform(0.1, 0.4, size=40)

    def law(t: float, q: float, v: float) -> float:
        return size * math.tanh(v / width) if bool(((begins <= t) & (t < ends)).any()) else 0.0

    m.friction.setdefault(i, []).append(law)
    return {"torque": Quantity(size, "N m")}


def _one_way(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    """A clutch that slips in one direction of torque: what pushes there arrives in part."""
    lost, side = quantile(severity, 0.15, 0.6), case.sign()

    def stage(t: float, out: list[float]) -> list[float]:
        return [x * (1.0 - lost) if k == i and x * side > 0 else x for k, x in enumerate(out)]

    m.given.append(stage)
    return {"lost": Quantity(lost, "1")}


def _wobble(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    """A player of commands whose clock runs fast and slow."""
    size, seconds, phase = quantile(severity, 0.02, 0.1), case.span(0.9, 1.8), case.span(-math.pi, math.pi)

    def shaped(time: np.ndarray, asked: np.ndarray) -> np.ndarray:
        at = time + size * (np.sin(2 * np.pi * time / seconds + phase) - math.sin(phase))
        return np.stack([np.interp(at, time, column) for column in asked.T], axis=1)

    m.asked.append(shaped)
    return {"size": Quantity(size, "s")}


UNKNOWN: dict[str, Make] = {
    "paddle_in_a_bath": _paddle,
    "shaken_stand": _shaken,
    "weak_supply": _sag,
    "catching": _grabs,
    "slipping_clutch": _one_way,
    "uneven_player": _wobble,
}
