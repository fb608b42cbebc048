"""What may be wrong with a servo world: 24 families of the contract and six kinds outside them.

A severity is a quantile of a range, as in every study; ranges are shares of what the motions ask of the
axis (torque, speed, travel), since small machines have no catalogue. Formulas are those of physics' usual
texts or others as good; only parameters with the contract's meaning carry its names. "N m" stands for N,
"rad" for m on an axis that slides.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Quantity, log_quantile, quantile
from samrl_core.blind_test.servo_worlds.drives import Scales
from samrl_core.blind_test.servo_worlds.engine import GearSpring, Law, Machine
from samrl_core.blind_test.servo_worlds.links import scaled, with_point
from samrl_core.blind_test.servo_worlds.mechanisms import Mechanism

Parameters = dict[str, Quantity]


@dataclass(frozen=True)
class Case:
    """What an effect is sized by; `draw` is the world's stream, `stream` the recording's."""

    mechanism: Mechanism
    scales: Scales
    peak: list[float]  # largest output of the described drive in the recordings (n,)
    held: list[float]  # of it at rest, against gravity
    open_loop: bool
    draw: np.random.Generator
    stream: np.random.Generator

    def rub(self, axis: int) -> float:
        """Torque that friction is sized by; in open loop nobody makes good what it takes."""
        return (0.4 if self.open_loop else 1.0) * self.scales.torque[axis]

    def span(self, low: float, high: float) -> float:
        """Uniform, of the world's stream."""
        return float(self.draw.uniform(low, high))

    def sign(self) -> float:
        """+1 or -1, of the world's stream."""
        return float(self.draw.choice((-1.0, 1.0)))


Make = Callable[[Machine, int, float, Case], Parameters]


def _rub(machine: Machine, axis: int, law: Law) -> None:
    machine.friction.setdefault(axis, []).append(law)


def _coulomb(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    level, width = quantile(severity, 0.04, 0.3) * case.rub(i), 0.015 * case.scales.speed[i]
    if any(m.dry):  # there it is one friction with that which is stated
        m.dry[i] += level
    else:
        _rub(m, i, lambda t, q, v: level * v / math.hypot(v, width))
    return {"Fc": Quantity(level, "N m")}


def _viscous(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    gradient = quantile(severity, 0.04, 0.4) * case.rub(i) / case.scales.speed[i]
    _rub(m, i, lambda t, q, v: gradient * v)
    return {"Fv": Quantity(gradient, "N m s/rad")}


def _stribeck(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    speed = case.scales.speed[i]
    drop, vs = quantile(severity, 0.05, 0.3) * case.rub(i), case.span(0.1, 0.3) * speed
    _rub(m, i, lambda t, q, v: drop * math.tanh(v / (0.01 * speed)) * math.exp(-abs(v) / vs))
    return {"drop": Quantity(drop, "N m"), "vs": Quantity(vs, "rad/s"), "d": Quantity(1.0, "1")}


def _asymmetry(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    mean, share = quantile(severity, 0.05, 0.25) * case.rub(i), case.sign() * case.span(0.4, 0.8)
    width = 0.015 * case.scales.speed[i]

    def law(t: float, q: float, v: float) -> float:
        return mean * (1.0 + (share if v > 0 else -share)) * math.tanh(v / width)

    _rub(m, i, law)
    return {"mean": Quantity(mean, "N m"), "share": Quantity(share, "1")}


def _tight_spots(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    bump = quantile(severity, 0.06, 0.4) * case.rub(i)
    order = 2 * math.pi * case.span(1.0, 2.5) / (2 * case.mechanism.reach[i])
    spot, width = case.span(-0.5, 0.5) * case.mechanism.reach[i], 0.015 * case.scales.speed[i]
    _rub(m, i, lambda t, q, v: bump * (0.15 + math.cos(0.5 * order * (q - spot)) ** 4) * math.tanh(v / width))
    return {"bump": Quantity(bump, "N m"), "order": Quantity(order, "1/rad")}


def _thermal(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    cold = quantile(severity, 0.06, 0.35) * case.rub(i)
    warm, seconds, width = 0.25 * cold, case.span(2.5, 5.0), 0.015 * case.scales.speed[i]

    def law(t: float, q: float, v: float) -> float:
        return (warm + (cold - warm) * math.exp(-max(t, 0.0) / seconds)) * math.tanh(v / width)

    _rub(m, i, law)
    return {"F0": Quantity(cold, "N m"), "Finf": Quantity(warm, "N m"), "T": Quantity(seconds, "s")}


def _presliding(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    level = quantile(severity, 0.06, 0.3) * case.rub(i)
    stiffness = level / (case.span(0.005, 0.02) * case.mechanism.reach[i])
    each, yields = stiffness / 6, [level * (k + 1) / 21 for k in range(6)]
    if level > 0:
        m.slip[i] = ([each] * 6, [y / each for y in yields], [0.0] * 6)
    return {"Fc": Quantity(level, "N m"), "sigma0": Quantity(stiffness, "N m/rad")}


def _ripple(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    amplitude = quantile(severity, 0.04, 0.3) * case.scales.torque[i]
    order = round(2 * math.pi * case.span(6.0, 14.0) / (2 * case.mechanism.reach[i]))
    phase, n = case.span(-math.pi, math.pi), len(m.links)

    def push(t: float, q: list[float], v: list[float]) -> list[float]:
        wave = math.sin(order * q[i] + phase) + 0.3 * math.sin(2 * order * q[i] + 2.0)
        return [amplitude * wave if k == i else 0.0 for k in range(n)]

    m.push.append(push)
    return {
        "amplitude": Quantity(amplitude, "N m"),
        "order": Quantity(float(order), "1/rad"),
        "phase": Quantity(phase, "rad"),
    }


def _cable(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    reach, n = case.mechanism.reach[i], len(m.links)
    stiffness = quantile(severity, 0.06, 0.5) * case.scales.torque[i] / reach
    slack = case.sign() * case.span(0.2, 0.8) * reach

    def push(t: float, q: list[float], v: list[float]) -> list[float]:
        x = q[i] - slack
        return [-stiffness * x * (1.0 + 0.3 * (x / (2 * reach)) ** 2) if k == i else 0.0 for k in range(n)]

    m.push.append(push)
    return {"k": Quantity(stiffness, "N m/rad"), "q0": Quantity(slack, "rad")}


def _backlash(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    half = log_quantile(severity, 0.003, 0.03) * case.mechanism.reach[i]
    flank = case.scales.torque[i] / (0.002 * case.mechanism.reach[i])

    def torque(twist: float) -> tuple[float, float]:
        depth = abs(twist) - half
        return (math.copysign(flank * depth, twist), flank) if depth > 0 else (0.0, 0.0)

    m.spring[i] = GearSpring(torque, 0.02 * math.sqrt(flank * m.rotor[i]))
    return {"b": Quantity(half, "rad"), "flank_stiffness": Quantity(flank, "N m/rad")}


def _elasticity(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    hertz = 14.0 * (3.0 / 14.0) ** severity if severity > 0 else 80.0
    stiffness = case.scales.inertia[i] * (2 * math.pi * hertz) ** 2
    damping = 2 * case.span(0.02, 0.06) * math.sqrt(stiffness * case.scales.inertia[i])
    m.spring[i] = GearSpring(lambda twist: (stiffness * twist, stiffness), damping)
    return {"K": Quantity(stiffness, "N m/rad"), "D": Quantity(damping, "N m s/rad")}


def _reflected(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    more = log_quantile(severity, 0.25, 2.5) * m.rotor[i]
    m.rotor[i] += more
    return {"Ja": Quantity(more, "kg m2")}


def _gain(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    error = case.sign() * quantile(severity, 0.04, 0.25)
    m.factor[i] *= 1.0 + error
    return {"e": Quantity(error, "1")}


def _saturation(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    # The joint must still be held up where it can be, and the limit must be reached by this motion.
    held = min(1.1 * case.held[i], 0.95 * case.peak[i])
    limit = max(case.peak[i] * (0.97 - 0.3 * severity), held) if severity > 0 else 9 * case.peak[i]

    def stage(t: float, out: list[float]) -> list[float]:
        return [min(max(x, -limit), limit) if k == i else x for k, x in enumerate(out)]

    m.given.append(stage)
    return {"L": Quantity(limit, "N m")}


def _low_pass(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    cutoff = 12.0 * (0.8 / 12.0) ** severity if severity > 0 else 1e6

    def shaped(time: np.ndarray, asked: np.ndarray) -> np.ndarray:
        keep = math.exp(-2 * math.pi * cutoff * float(time[1] - time[0]))
        out, at = asked.copy(), float(asked[0, i])
        for k, x in enumerate(asked[:, i].tolist()):
            at = keep * at + (1.0 - keep) * x
            out[k, i] = at
        return out

    m.asked.append(shaped)
    return {"fc": Quantity(cutoff, "Hz"), "acts_on": Quantity("command", "channel")}


def _delay(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    delay = quantile(severity, 0.004, 0.06)

    def shaped(time: np.ndarray, asked: np.ndarray) -> np.ndarray:
        out = asked.copy()
        out[:, i] = np.interp(time - delay, time, asked[:, i])
        return out

    m.asked.append(shaped)
    return {"T": Quantity(delay, "s"), "acts_on": Quantity("command", "channel")}


def _jitter(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    held, longest = quantile(severity, 0.1, 0.6), 0.06

    def shaped(time: np.ndarray, asked: np.ndarray) -> np.ndarray:
        out, k, dt = asked.copy(), 0, float(time[1] - time[0])
        while k < len(time):
            length = max(1, round(case.stream.uniform(0.01, longest) / dt))
            free = max(1, round(length * (1.0 - held) / max(held, 1e-9)))
            k += free
            out[k : k + length] = asked[min(k, len(time) - 1)]
            k += length
        return out

    if held > 0:
        m.asked.append(shaped)
    return {"held": Quantity(held, "1"), "longest": Quantity(longest, "s")}


_GAINS = {
    "position_servo": ("stiffness", "damping"),
    "voltage_servo": ("proportional", "derivative"),
    "velocity_drive": ("position_gain", "velocity_gain"),
}


def _controller_gain(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    stiff = case.sign() * quantile(severity, 0.08, 0.4)
    damp = case.sign() * abs(stiff) * case.span(0.3, 0.8)
    for key, error in zip(_GAINS[m.drive["type"]], (stiff, damp), strict=True):
        m.drive[key] = [g * (1 + error) if k == i else g for k, g in enumerate(m.drive[key])]
    return {"eK": Quantity(stiff, "1"), "eD": Quantity(damp, "1")}


def _dead_band(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    width = quantile(severity, 0.006, 0.05) * case.mechanism.reach[i]
    m.wider[i] += width
    return {"width": Quantity(width, "rad")}


def _offset(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    error = case.sign() * log_quantile(severity, 0.01, 0.12)
    m.read.append(lambda t, q, v: ([x + error if k == i else x for k, x in enumerate(q)], v))
    return {"e": Quantity(error, "rad")}


def _eccentricity(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    size = log_quantile(severity, 0.003, 0.03) * case.mechanism.reach[i]
    order = round(2 * math.pi * case.span(2.0, 5.0) / (2 * case.mechanism.reach[i]))
    phi = case.span(-math.pi, math.pi)

    def read(t: float, q: list[float], v: list[float]) -> tuple[list[float], list[float]]:
        angle = order * q[i] + phi
        position = [x + size * math.sin(angle) if k == i else x for k, x in enumerate(q)]
        factor = 1.0 + size * order * math.cos(angle)
        return position, [x * factor if k == i else x for k, x in enumerate(v)]

    m.read.append(read)
    return {
        "a": Quantity(size, "rad"),
        "harmonic": Quantity(float(order), "1/rad"),
        "phi": Quantity(phi, "rad"),
    }


def _payload(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    last = m.links[-1]
    mass, at = quantile(severity, 0.08, 0.6) * last.mass, 2.0 * last.reach
    m.links = (*m.links[:-1], with_point(last, mass, at))
    point = {f"com_{axis}": Quantity(at * a, "m") for axis, a in zip("xyz", last.along, strict=True)}
    return {"mass": Quantity(mass, "kg"), **point}


def _link_inertia(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    error = case.sign() * quantile(severity, 0.1, 0.4)
    link = scaled(m.links[i], 1.0 + error, 0.0, 1.0 + error)
    m.links = (*m.links[:i], link, *m.links[i + 1 :])
    return {"mass_error": Quantity(error, "1")}


def _tilt(m: Machine, i: int, severity: float, case: Case) -> Parameters:
    size, angle = log_quantile(severity, 0.01, 0.12), case.span(-math.pi, math.pi)
    ax, ay = size * math.cos(angle), size * math.sin(angle)
    cross = np.array([[0.0, 0.0, ay], [0.0, 0.0, -ax], [-ay, ax, 0.0]])  # of the rotation vector (ax, ay, 0)
    turn = (
        np.eye(3) + np.sinc(size / math.pi) * cross + 0.5 * np.sinc(size / (2 * math.pi)) ** 2 * cross @ cross
    )
    m.gravity = turn.T @ m.gravity
    return {"ax": Quantity(ax, "rad"), "ay": Quantity(ay, "rad")}


FAMILIES: dict[str, Make] = {
    "coulomb_friction": _coulomb,
    "viscous_friction": _viscous,
    "stribeck_friction": _stribeck,
    "friction_asymmetry": _asymmetry,
    "position_dependent_friction": _tight_spots,
    "thermal_friction": _thermal,
    "presliding": _presliding,
    "gear_ripple": _ripple,
    "backlash": _backlash,
    "joint_elasticity": _elasticity,
    "reflected_inertia": _reflected,
    "actuator_gain": _gain,
    "torque_saturation": _saturation,
    "command_low_pass": _low_pass,
    "command_delay": _delay,
    "packet_jitter": _jitter,
    "controller_gain": _controller_gain,
    "dead_band": _dead_band,
    "encoder_offset": _offset,
    "encoder_eccentricity": _eccentricity,
    "payload": _payload,
    "link_inertia": _link_inertia,
    "base_tilt": _tilt,
    "cable": _cable,
}
# Formulas that are the contract's own; the others' parameters are not compared.
USUAL = frozenset(FAMILIES) - {
    "stribeck_friction", "friction_asymmetry", "position_dependent_friction", "presliding", "gear_ripple",
    "packet_jitter", "encoder_eccentricity", "cable",
}  # fmt: skip
