"""How a servo world's user logs: rates, units, columns, and the mapping that tells an importer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from samrl_core.blind_test.servo_worlds.drives import OPEN_LOOP
from samrl_core.blind_test.servo_worlds.engine import Log
from samrl_core.blind_test.servo_worlds.mechanisms import Mechanism

STATES_TOPIC, TARGETS_TOPIC = "/joint_states", "/targets"  # both of JointState
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}


@dataclass(frozen=True)
class Style:
    """One user's habits."""

    every: int  # of the drive's ticks that are logged
    time_unit: str
    in_counts: bool
    counts: tuple[float, ...]  # of the encoders per rad or m, at the joint
    degrees: bool  # and millimetres, where not in counts
    velocity: bool  # is logged
    effort: str  # voltage, current, torque, input, absent
    separator: str  # of the file's cells
    decimal: str  # sign of the file's numbers
    bag: bool  # of ROS 2, in SI units, instead of CSV


def choose_style(mechanism: Mechanism, drive: dict[str, Any], rng: np.random.Generator) -> Style:
    """Habits that fit the machine."""
    kind, period = drive["type"], float(drive["period_s"])
    known = {
        # What an integral makes good shows in the effort alone.
        "position_servo": ("torque",) if "integral" in drive else ("torque", "absent"),
        "voltage_servo": ("voltage", "current", "absent"),
        "velocity_drive": ("torque",),
        "stepper": ("absent",),
    }.get(kind, ("input",))
    slides = [link.kind == "prismatic" for link in mechanism.links]
    per_turn = float(rng.choice([16384.0, 65536.0, 262144.0]))
    lines = float(rng.choice([1e5, 4e5]))
    rate = float(rng.choice([125.0, 250.0, 500.0]))
    comma, bag = bool(rng.random() < 0.2), bool(rng.random() < 0.35)
    return Style(
        every=max(1, round(1.0 / (rate * period))),
        time_unit="s" if bag else str(rng.choice(list(_SECONDS))),
        in_counts=not bag and bool(rng.random() < 0.3),
        counts=tuple(lines if s else per_turn / (2.0 * math.pi) for s in slides),
        degrees=not bag and bool(rng.random() < 0.5),
        velocity=bool(rng.random() < 0.5),
        effort=str(rng.choice(known)),
        separator=";" if comma else ",",
        decimal="," if comma else ".",
        bag=bag,
    )


def _column(what: str, joint: str) -> str:
    return f"{what}_{joint}"


def _unit(style: Style, mechanism: Mechanism, i: int) -> float:
    """How many of the log's units make one rad or m, for positions."""
    if style.in_counts:
        return style.counts[i]
    if not style.degrees:
        return 1.0
    return 1000.0 if mechanism.links[i].kind == "prismatic" else 180.0 / math.pi


def table_of(
    log: Log, asked: np.ndarray, drive: dict[str, Any], style: Style, mechanism: Mechanism
) -> dict[str, np.ndarray]:
    """Columns (N,) as they stand in the log's file."""
    rows = slice(None, None, style.every)
    time = log.time[rows] / _SECONDS[style.time_unit]
    table = {"time": np.round(time, 6)}
    for i, joint in enumerate(drive["joints"]):
        unit = _unit(style, mechanism, i)
        seen = np.round(log.position[rows, i] * style.counts[i]) / style.counts[i]
        table[_column("pos", joint)] = _digits(seen * unit, style.in_counts)
        if style.velocity:
            table[_column("vel", joint)] = _digits(log.velocity[rows, i] * unit, False)
        if drive["type"] not in OPEN_LOOP:
            table[_column("target", joint)] = _digits(asked[rows, i] * unit, False)
        if style.effort in ("voltage", "torque", "input"):
            name = {"voltage": "volt", "torque": "torque", "input": "input"}[style.effort]
            table[_column(name, joint)] = _digits(log.out[rows, i], False)
        elif style.effort == "current":
            table[_column("mA", joint)] = _digits(1000.0 * log.current[rows, i], False)
    return table


def _digits(values: np.ndarray, whole: bool) -> np.ndarray:
    """Seven significant digits, or whole counts."""
    if whole:
        return np.round(values)
    return np.array([float(f"{v:.7g}") for v in values.tolist()])


def mapping_of(
    mechanism: Mechanism,
    drive: dict[str, Any],
    style: Style,
    tolerances: dict[str, float],
    letters: tuple[str, ...],
) -> dict[str, Any]:
    """The mapping for `samrl bag import`, as the user writes it; the last recording is held out."""
    joints: list[str] = list(drive["joints"])
    columns = {"pos": "pos"} | ({"vel": "vel"} if style.velocity else {})
    if drive["type"] not in OPEN_LOOP:
        columns["target"] = "target"
    name = {"voltage": "volt", "torque": "torque", "input": "input", "current": "mA"}.get(style.effort)
    if name:
        columns[name] = name
    units = [_unit(style, mechanism, i) for i in range(len(joints))]

    def scaled(what: str) -> list[str]:
        return [
            f"{_column(what, j)} / {u:.12g}" if u != 1.0 else _column(what, j)
            for j, u in zip(joints, units, strict=True)
        ]

    controller = dict(drive)
    channels: dict[str, Any] = {
        "states": {"position": scaled("pos"), "velocity": scaled("vel") if style.velocity else "derivative"}
    }
    if drive["type"] not in OPEN_LOOP:
        channels["command"] = {"position": scaled("target"), "velocity": "derivative"}
    if name:
        channels["commanded_effort"] = {"effort": _efforts(drive, style, name)}
    if style.effort == "current":
        controller["effort_from"] = "current"
    if style.bag:
        for channel, quantities in channels.items():
            quantities["source"] = "targets" if channel == "command" else "states"
    return {
        "about": f"{mechanism.name} with a {drive['type'].replace('_', ' ')}",
        "joints": joints,
        "urdf": "model.urdf",
        "controller": controller,
        "tolerances": dict(tolerances),
        "sources": _sources(style, columns, joints),
        "channels": channels,
        "recordings": [
            {"name": letter, "role": "held_out" if letter == letters[-1] else "fit"} for letter in letters
        ],
    }


def _sources(style: Style, columns: dict[str, str], joints: list[str]) -> dict[str, Any]:
    if not style.bag:
        return {
            "log": {
                "file": "log_{name}.csv",
                "csv": {"delimiter": style.separator, "decimal": style.decimal},
                "time": {"column": "time", "unit": style.time_unit},
                "columns": {_column(c, j): _column(c, j) for c in columns for j in joints},
            }
        }
    fields = {c: {"pos": "position", "vel": "velocity"}.get(c, "effort") for c in columns if c != "target"}
    found: dict[str, Any] = {
        "states": {
            "file": "log_{name}.mcap",
            "part": STATES_TOPIC,
            "columns": {_column(c, j): f"{field}.{j}" for c, field in fields.items() for j in joints},
        }
    }
    if "target" in columns:
        found["targets"] = {
            "file": "log_{name}.mcap",
            "part": TARGETS_TOPIC,
            "columns": {_column("target", j): f"position.{j}" for j in joints},
        }
    return found


def _efforts(drive: dict[str, Any], style: Style, name: str) -> list[str]:
    """Formulas of the effort at each joint [N m]."""
    out = []
    for i, joint in enumerate(drive["joints"]):
        column = _column(name, joint)
        if style.effort == "torque":
            out.append(column)
            continue
        constant = drive["torque_constant"][i] * drive["gear_ratio"][i]
        if style.effort == "current":
            out.append(f"{constant:.12g} * {column} / 1000")
        elif drive["type"] == "current_motor":
            out.append(f"{constant:.12g} * {column}")
        else:
            out.append(f"{constant / drive['resistance'][i]:.12g} * {column}")
    return out
