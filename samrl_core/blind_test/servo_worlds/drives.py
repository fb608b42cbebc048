"""Drives as they are sold: what a data sheet says of them, and what they do from tick to tick.

Laws as the interface of controller kinds states them; torque is that of the joint, N the gear ratio.
Between ticks the output is held; back-EMF and a stepper's magnetic spring act all the time, so they come as
torque = a - c v'.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from samrl_core.blind_test.servo_worlds.mechanisms import Mechanism

OPEN_LOOP = ("voltage_motor", "current_motor")
WITH_BACK_EMF = ("voltage_servo", "voltage_motor")
_GRAVITY = np.array([0.0, 0.0, -9.80665])
FASTEST_HZ = 1.2  # of the motions that a drive is chosen for


@dataclass(frozen=True)
class Scales:
    """What the motions ask of each axis, (n,): so large a drive is bought."""

    torque: list[float]  # [N m or N]
    speed: list[float]  # [rad/s or m/s]
    inertia: list[float]  # of the mechanism alone at rest [kg m2 or kg]


def scales_of(mechanism: Mechanism) -> Scales:
    """Gravity and acceleration over the mechanism's range."""
    motion, count = mechanism.motion(mechanism.links), len(mechanism.links)
    weights = np.zeros(count)
    for share in np.linspace(-1.0, 1.0, 9):
        q = [share * r for r in mechanism.reach]
        weights = np.maximum(weights, np.abs(motion(q, [0.0] * count, _GRAVITY)[1]))
    mass = motion([0.0] * count, [0.0] * count, _GRAVITY)[0]
    inertia = [float(mass[i][i]) for i in range(count)]
    fast = 2.0 * math.pi * FASTEST_HZ
    torque = [
        float(w) + 1.5 * j * 0.5 * r * fast**2
        for w, j, r in zip(weights, inertia, mechanism.reach, strict=True)
    ]
    return Scales(torque, [0.7 * r * fast for r in mechanism.reach], inertia)


def _sheet(values: list[float]) -> list[float]:
    """Three digits, as a data sheet has them."""
    return [float(f"{v:.3g}") for v in values]


def choose_drive(kind: str, mechanism: Mechanism, scales: Scales, rng: np.random.Generator) -> dict[str, Any]:
    """Description of a controller of a kind that suits the mechanism: the JSON that a diagnosis gets."""
    count, each = len(mechanism.links), range(len(mechanism.links))
    torque, inertia = scales.torque, scales.inertia
    slides = [link.kind == "prismatic" for link in mechanism.links]
    ratio = [
        float(f"{(2 * math.pi / rng.uniform(0.008, 0.02)) if s else float(rng.integers(30, 121)):.4g}")
        for s in slides
    ]
    if kind == "stepper":
        ratio = [
            float(rng.choice([1.0, 2.0])) for _ in each
        ]  # direct, or a belt: it turns through whole steps
    rotor = [rng.uniform(0.2, 0.8) * j for j in inertia]
    total = [a + b for a, b in zip(inertia, rotor, strict=True)]
    period = float(rng.choice([0.001, 0.002, 0.004])) if kind != "stepper" else 0.001  # a step at a time
    made: dict[str, Any] = {
        "type": kind,
        "joints": [link.joint for link in mechanism.links],
        "period_s": period,
        "gravity_compensation": False,
    }
    limit = _sheet([3.0 * t for t in torque])
    omega = [float(rng.uniform(16.0, 28.0)) for _ in each]
    stiffness = [m * w**2 for m, w in zip(total, omega, strict=True)]
    damping = [2.0 * rng.uniform(0.6, 0.9) * m * w for m, w in zip(total, omega, strict=True)]
    if kind == "position_servo":
        made |= {
            "stiffness": _sheet(stiffness),
            "damping": _sheet(damping),
            "effort_limit": limit,
            "armature": _sheet(rotor),
            "velocity_feedforward": [float(rng.choice([0.0, 1.0]))] * count,
        }
        if rng.random() < 0.5:
            made["dead_band"] = _sheet([rng.uniform(0.001, 0.003) * r for r in mechanism.reach])
            made["punch"] = _sheet([0.03 * t for t in torque])
        if rng.random() < 0.4:
            made["integral"] = _sheet([2.0 * k for k in stiffness])
        return made
    if kind == "velocity_drive":
        gain = [m * rng.uniform(20.0, 35.0) for m in total]
        made |= {
            "velocity_gain": _sheet(gain),
            "position_gain": _sheet(rng.uniform(6, 12, size=count).tolist()),
            "integral": _sheet([8.0 * g for g in gain]),
            "effort_limit": limit,
            "armature": _sheet(rotor),
        }
        return made
    made["gear_ratio"] = ratio
    made["rotor_inertia"] = _sheet([j / n**2 for j, n in zip(rotor, ratio, strict=True)])
    if kind == "stepper":
        holding = [2.5 * t / n for t, n in zip(torque, ratio, strict=True)]
        springs = [h * n * 50.0 * n for h, n in zip(holding, ratio, strict=True)]
        made |= {
            "holding_torque": _sheet(holding),
            "full_steps": [200.0] * count,
            "microsteps": [16.0] * count,
            "encoder": "link",
            "damping": _sheet([0.4 * math.sqrt(k * m) for k, m in zip(springs, total, strict=True)]),
        }
        return made
    volts = float(rng.choice([12.0, 24.0]))
    no_load = [5.0 * s for s in scales.speed]
    constant = [volts / (w * n) for w, n in zip(no_load, ratio, strict=True)]
    if kind == "current_motor":
        made |= {
            "torque_constant": _sheet(constant),
            "current_limit": _sheet(
                [3.0 * t / (k * n) for t, k, n in zip(torque, constant, ratio, strict=True)]
            ),
        }
        return made
    resistance = [k * n * volts / (3.5 * t) for k, n, t in zip(constant, ratio, torque, strict=True)]
    made |= {
        "torque_constant": _sheet(constant),
        "resistance": _sheet(resistance),
        "voltage_limit": [volts] * count,
    }
    if kind == "voltage_servo":
        per_volt = [k * n / r for k, n, r in zip(constant, ratio, resistance, strict=True)]
        emf = [g * k * n for g, k, n in zip(per_volt, constant, ratio, strict=True)]
        made["proportional"] = _sheet([k / g for k, g in zip(stiffness, per_volt, strict=True)])
        made["derivative"] = _sheet(
            [max(d - e, 0.0) / g for d, e, g in zip(damping, emf, per_volt, strict=True)]
        )
        made["velocity_feedforward"] = [float(rng.choice([0.0, 1.0]))] * count
        if rng.random() < 0.5:
            made["dead_band"] = _sheet([rng.uniform(0.001, 0.003) * r for r in mechanism.reach])
            made["punch"] = _sheet([0.03 * t / g for t, g in zip(torque, per_volt, strict=True)])
    return made


def rotors(drive: dict[str, Any]) -> list[float]:
    """Rotor inertia at the joint (n,) [kg m2]."""
    if "armature" in drive:
        return list(drive["armature"])
    return [j * n**2 for j, n in zip(drive["rotor_inertia"], drive["gear_ratio"], strict=True)]


class ServoDrive:
    """One recording's drives; `described` may differ from what a diagnosis is told."""

    def __init__(self, described: dict[str, Any], factor: list[float], wider: list[float]) -> None:
        """Of a description, factors of the torque constants, and widths added to dead bands (n,)."""
        self.kind: str = described["type"]
        self._d, self._factor = described, factor
        n = len(described["joints"])
        self._band = [a + b for a, b in zip(described.get("dead_band", [0.0] * n), wider, strict=True)]
        self._punch = described.get("punch", [0.0] * n)
        self._integral = [0.0] * n
        self.out = [0.0] * n  # u, V, i, or the position stepped to
        if self.kind in ("voltage_servo", "voltage_motor"):
            constants = zip(
                described["torque_constant"], described["gear_ratio"], described["resistance"], strict=True
            )
            self._per_volt = [k * ratio / r for k, ratio, r in constants]
        if "torque_constant" in described:
            self._kn = [
                k * n for k, n in zip(described["torque_constant"], described["gear_ratio"], strict=True)
            ]

    def tick(
        self, asked: list[float], asked_rate: list[float], q: list[float], v: list[float]
    ) -> list[float]:
        """New output from what is asked (positions, or the input of an open-loop drive) and measured."""
        d, kind = self._d, self.kind
        if kind in OPEN_LOOP:
            limit = d["voltage_limit" if kind == "voltage_motor" else "current_limit"]
            self.out = [min(max(x, -m), m) for x, m in zip(asked, limit, strict=True)]
        elif kind == "stepper":
            geared = zip(d["full_steps"], d["microsteps"], d["gear_ratio"], strict=True)
            steps = [full * micro * n / (2.0 * math.pi) for full, micro, n in geared]
            self.out = [round(x * s) / s for x, s in zip(asked, steps, strict=True)]
        else:
            self.out = [self._law(i, asked[i], asked_rate[i], q[i], v[i]) for i in range(len(q))]
        return self.out

    def _law(self, i: int, asked: float, rate: float, q: float, v: float) -> float:
        d = self._d
        ahead = rate * (d["velocity_feedforward"][i] if "velocity_feedforward" in d else 1.0)
        if self.kind == "velocity_drive":
            error = d["position_gain"][i] * (asked - q) + ahead - v
            free, most, ki = d["velocity_gain"][i] * error, d["effort_limit"][i], d["integral"][i]
        else:
            volts = self.kind == "voltage_servo"
            e = asked - q
            error = math.copysign(max(abs(e) - self._band[i], 0.0), e)
            free = d["proportional" if volts else "stiffness"][i] * error
            free += math.copysign(self._punch[i], error) if error else 0.0
            free += d["derivative" if volts else "damping"][i] * (ahead - v)
            most = d["voltage_limit" if volts else "effort_limit"][i]
            ki = d["integral"][i] if "integral" in d else 0.0
        out = free + ki * self._integral[i]
        if abs(out) < most or out * error < 0:
            self._integral[i] += error * d["period_s"]
        return min(max(out, -most), most)

    def torque(self, i: int, given: float, position: float, dt: float) -> tuple[float, float]:
        """(a, c) of torque a - c v' on axis i under an output that was given to the motor."""
        d, factor = self._d, self._factor[i]
        if self.kind in WITH_BACK_EMF:
            return factor * self._per_volt[i] * given, factor * self._per_volt[i] * self._kn[i]
        if self.kind == "current_motor":
            return factor * self._kn[i] * given, 0.0
        if self.kind == "stepper":
            n = d["gear_ratio"][i]
            size, poles = factor * d["holding_torque"][i] * n, 0.25 * d["full_steps"][i] * n
            angle = poles * (given - position)
            spring = max(size * poles * math.cos(angle), 0.0)
            return size * math.sin(angle), d["damping"][i] + dt * spring
        return factor * given, 0.0

    def current(self, i: int, given: float, velocity: float) -> float:
        """Motor current [A] of a kind with back-EMF."""
        return (given - self._kn[i] * velocity) / self._d["resistance"][i]
