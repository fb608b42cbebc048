"""One servo world: three logs as its user keeps them, the URDF, the mapping, and the label to be sealed."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from samrl_core.blind_test.servo_worlds.drives import OPEN_LOOP, choose_drive, scales_of
from samrl_core.blind_test.servo_worlds.effects import FAMILIES, Case
from samrl_core.blind_test.servo_worlds.engine import Log, Machine, nominal_machine, run_machine
from samrl_core.blind_test.servo_worlds.links import scaled, urdf
from samrl_core.blind_test.servo_worlds.log_style import choose_style, mapping_of, table_of
from samrl_core.blind_test.servo_worlds.mechanisms import Mechanism, mechanisms
from samrl_core.blind_test.servo_worlds.motions import LETTERS, motion
from samrl_core.blind_test.servo_worlds.plan import ROLE, ServoItem
from samrl_core.blind_test.servo_worlds.stiction import (
    near_stated,
    ragged,
    rounding_encoder,
    with_friction,
)
from samrl_core.blind_test.servo_worlds.unknown import UNKNOWN

# Half widths that the mapping states; the machine is sampled within them.
TOLERANCES = {
    "mass": 0.03, "center_of_mass": 0.003, "inertia": 0.05, "armature": 0.05, "coulomb_friction": 0.01,
    "viscous_friction": 0.01, "torque_offset": 0.004, "base_tilt": 0.002, "stamp": 0.001,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class ServoWorld:
    """All that is written of one servo world."""

    tables: dict[str, dict[str, np.ndarray]]  # letter -> column -> values (N,)
    mapping: dict[str, Any]
    urdf: str
    label: dict[str, Any]


def make_servo_world(item: ServoItem) -> ServoWorld:
    """Logs A, B and C with their mapping, URDF and label; the same for the same item.

    Raises:
        RanAwayError: it left all bounds.
    """
    sizes, drives, styles, background, noise, effects, streams, rubs = np.random.default_rng(item.seed).spawn(
        8
    )
    mechanism = next(m for m in mechanisms(sizes) if m.name == item.mechanism)
    scales = scales_of(mechanism)
    if item.sticks:
        share = 0.4 if item.drive in OPEN_LOOP else 1.0  # in open loop nobody makes good what friction takes
        rub = [share * t for t in scales.torque]
        mechanism = replace(mechanism, links=with_friction(mechanism.links, rub, scales.speed, rubs))
    drive = choose_drive(item.drive, mechanism, scales, drives)
    style = choose_style(mechanism, drive, styles)
    limit, fastest = [3.0 * t for t in scales.torque], [4.0 * s for s in scales.speed]
    time = np.arange(0.0, item.duration_s, float(drive["period_s"]))
    wishes = {letter: motion(letter, mechanism, time, styles) for letter in LETTERS}
    asked = {k: _input(mechanism, drive, time, w) for k, w in wishes.items()}
    peak, held = _demands(mechanism, drive, time, asked["B"])
    logger_seed, encoder_seed = (int(s) for s in rubs.integers(2**62, size=2))
    background_seed, effect_seed = (int(s.integers(2**62)) for s in (background, effects))
    tables, label_effects, real = {}, [], {}
    for letter in LETTERS:
        machine = nominal_machine(mechanism, drive)
        real = _mismatch(machine, limit, fastest, np.random.default_rng(background_seed))
        draws = np.random.default_rng(effect_seed).spawn(len(item.effects))
        label_effects = []
        for effect, draw in zip(item.effects, draws, strict=True):
            case = Case(
                mechanism,
                scales,
                peak,
                held,
                drive["type"] in OPEN_LOOP,
                draw,
                np.random.default_rng(int(streams.integers(2**62))),
            )
            made = {**FAMILIES, **UNKNOWN}[effect.family](machine, effect.axis, effect.severity, case)
            parameters = {name: asdict(quantity) for name, quantity in made.items()}
            label_effects.append({**asdict(effect), "onset": None, "series": 3, "parameters": parameters})
        steps = (2e-4 * min(mechanism.reach), 3e-3 * min(scales.speed))
        if item.sticks:
            rng = np.random.default_rng(encoder_seed)
            machine.read.append(rounding_encoder(style.counts, float(drive["period_s"]), rng))
            steps = (0.0, 0.0)
        log = run_machine(mechanism, machine, time, asked[letter], _start(asked[letter], drive), steps, noise)
        tables[letter] = table_of(log, asked[letter], drive, style, mechanism)
        if item.sticks:
            tables[letter] = ragged(tables[letter], np.random.default_rng([logger_seed, ord(letter)]))
    label = {
        "schema": 1, "id": item.id, "set": item.set, "engine": "hand-written", "arm": ROLE, "programme": 0,
        "mechanism": item.mechanism, "drive": item.drive, "effects": label_effects,
        "background": {"scale": 1.0, **real}, "seed": item.seed,
    }  # fmt: skip
    mapping = mapping_of(mechanism, drive, style, TOLERANCES, LETTERS)
    return ServoWorld(tables, mapping, urdf(mechanism.name, mechanism.links, limit, fastest), label)


def _input(mechanism: Mechanism, drive: dict[str, Any], time: np.ndarray, wished: np.ndarray) -> np.ndarray:
    """What is sent to the drive (N, n): the motion itself, or in open loop an input that makes about it."""
    if drive["type"] not in OPEN_LOOP:
        return wished
    nominal = nominal_machine(mechanism, drive)
    law = mechanism.motion(mechanism.links)
    v = np.gradient(wished, time, axis=0)
    a = np.gradient(v, time, axis=0)
    out = np.empty_like(wished)
    for k in range(len(time)):
        mass, bias = law(wished[k].tolist(), v[k].tolist(), nominal.gravity)
        out[k] = np.array(mass) @ a[k] + np.array(nominal.rotor) * a[k] + np.array(bias)
    kn = np.array(drive["torque_constant"]) * np.array(drive["gear_ratio"])
    if drive["type"] == "current_motor":
        return out / kn
    return out / kn * np.array(drive["resistance"]) + kn * v


def _start(asked: np.ndarray, drive: dict[str, Any]) -> list[float]:
    return [0.0] * asked.shape[1] if drive["type"] in OPEN_LOOP else asked[0].tolist()


def _demands(
    mechanism: Mechanism, drive: dict[str, Any], time: np.ndarray, asked: np.ndarray
) -> tuple[list[float], list[float]]:
    """Largest outputs (n,) of the machine as described, and those at rest against gravity."""
    machine = nominal_machine(mechanism, drive)
    still = np.random.default_rng(0)
    log: Log = run_machine(mechanism, machine, time, asked, _start(asked, drive), (0.0, 0.0), still)
    law, zero = mechanism.motion(mechanism.links), [0.0] * asked.shape[1]
    weights = [np.abs(law(row.tolist(), zero, machine.gravity)[1]) for row in log.position[::50]]
    return np.abs(log.out).max(axis=0).tolist(), np.max(weights, axis=0).tolist()


def _mismatch(
    machine: Machine, limit: list[float], fastest: list[float], rng: np.random.Generator
) -> dict[str, Any]:
    """Write a sample within the tolerances into the machine; returns what was drawn."""
    count, t = len(machine.links), TOLERANCES
    mass, reach, inertia = (rng.uniform(-1, 1, size=count) for _ in range(3))
    machine.links = tuple(
        scaled(link, 1 + t["mass"] * a, t["center_of_mass"] * b * bool(link.reach), 1 + t["inertia"] * c)
        for link, a, b, c in zip(machine.links, mass, reach, inertia, strict=True)
    )
    rotor = 1.0 + t["armature"] * rng.uniform(-1, 1, size=count)
    machine.rotor = [r * float(f) for r, f in zip(machine.rotor, rotor, strict=True)]
    coulomb, viscous = rng.uniform(0, 1, size=(2, count))
    dry = [t["coulomb_friction"] * x for x in limit]
    wet = [t["viscous_friction"] * x / v for x, v in zip(limit, fastest, strict=True)]
    if any(machine.dry):
        machine.dry = [
            near_stated(f, w, c) for f, w, c in zip(machine.dry, dry, 2 * coulomb - 1, strict=True)
        ]
        machine.viscous = [
            near_stated(f, w, c) for f, w, c in zip(machine.viscous, wet, 2 * viscous - 1, strict=True)
        ]
    else:
        machine.coulomb, machine.viscous = (
            [x * float(c) for x, c in zip(widths, draws, strict=True)]
            for widths, draws in ((dry, coulomb), (wet, viscous))
        )
    tilt = t["base_tilt"] * rng.uniform(-1, 1, size=2)
    size = float(np.linalg.norm(machine.gravity))
    leaning = np.array([math.sin(tilt[1]), -math.sin(tilt[0]), 0.0])
    machine.gravity = size * (leaning + np.array([0, 0, -math.sqrt(1 - float(leaning @ leaning))]))
    rubs = machine.dry if any(machine.dry) else machine.coulomb
    return {"link_mass_error": (t["mass"] * mass).tolist(), "coulomb_nm": rubs,
            "viscous_nms_rad": machine.viscous, "base_tilt_rad": tilt.tolist()}  # fmt: skip
