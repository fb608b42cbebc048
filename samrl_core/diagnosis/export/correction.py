"""What a diagnosis changes in the nominal arm, as numbers that every simulator's writer reads.

Fields are those of `PlantParameters`, only the ones that differ from nominal. A report keeps its correction
in two files, so that it can be exported later: texts and values in `correction.json`, arrays in
`correction.npz`.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.common.array_file import unpacked, write_arrays
from samrl_core.common.errors import InputError
from samrl_core.common.files import is_file, read_whole, write_whole
from samrl_core.common.text_files import parse_json, read_text
from samrl_core.diagnosis.simulation.plant_parameters import joint_fields

JSON_FILE, ARRAY_FILE = "correction.json", "correction.npz"
SCHEMA = 1
MOST_BYTES = 1 << 30  # of the arrays
BODY = "inertial_delta"  # (J, 10), a payload at the flange included
MOTION = ("time", "position", "velocity", "torque")
HELD_OUT = ("time", "start_position", "start_velocity")


@dataclass(frozen=True)
class NominalLaw:
    """The described controller as a re-simulation needs it, clip(K (q_d - q) + D (dq_d - dq) + g(q) + u)."""

    stiffness: tuple[float, ...]  # [N m/rad]
    damping: tuple[float, ...]  # [N m s/rad]
    effort_limit: tuple[float, ...]  # [N m], infinite where there is none
    period_s: float
    gravity_compensation: bool
    gravity: tuple[float, float, float]  # [m/s2] in the base frame


@dataclass(frozen=True, eq=False)
class Correction:
    """A named set of effects as changes of one arm's model."""

    effects: tuple[str, ...]  # family@place
    joints: tuple[str, ...]
    fields: dict[str, np.ndarray]  # of PlantParameters; (J,), (J, 10), (3,) or ()
    unsimulated: tuple[str, ...]  # effects that no simulation of ours has: no field stands for them
    urdf: str  # nominal, normal form, tool included nowhere
    friction: np.ndarray  # (J,) nominal [N m]
    damping: np.ndarray  # (J,) nominal [N m s/rad]
    armature: np.ndarray  # (J,) nominal [kg m2]
    law: NominalLaw | None
    tool: dict[str, Any] | None  # mass, center_of_mass, inertia at the flange; None: none
    promise: dict[str, Any]  # shrink and ci95 of the report
    # Form, path and source of the user's model, if there is one.
    model: dict[str, str] = field(default_factory=dict)
    samples: dict[str, np.ndarray] = field(default_factory=dict)  # field -> (S, ...) of the posterior
    # MOTION of the fitted recordings, (N,) and (N, J).
    motion: dict[str, np.ndarray] = field(default_factory=dict)
    held_out: tuple[
        dict[str, np.ndarray], ...
    ] = ()  # one per recording: HELD_OUT, command_*, measured_*, scale_*

    def at(self, name: str, joint: int) -> float:
        """A joint field's value, neutral where it is not changed."""
        if name in self.fields:
            return float(self.fields[name][joint])
        return float(joint_fields()[name]["default"])

    def changes(self, name: str, joint: int) -> bool:
        """Whether a joint field differs from neutral there."""
        return name in self.fields and float(self.fields[name][joint]) != float(
            joint_fields()[name]["default"]
        )


def write_correction(correction: Correction, folder: Path) -> None:
    """Both files into a report's folder."""
    c = correction
    about = {
        "schema": SCHEMA, "effects": c.effects, "joints": c.joints, "unsimulated": c.unsimulated,
        "fields": {name: _listed(value) for name, value in c.fields.items()},
        "nominal": {name: getattr(c, name).tolist() for name in ("friction", "damping", "armature")},
        "law": None if c.law is None else {k: _listed(v) for k, v in vars(c.law).items()},
        "tool": c.tool, "promise": c.promise, "model": c.model, "urdf": c.urdf, "recordings": len(c.held_out),
    }  # fmt: skip
    arrays = {f"sample.{name}": value for name, value in c.samples.items()}
    arrays |= {f"motion.{name}": value for name, value in c.motion.items()}
    for k, run in enumerate(c.held_out):
        arrays |= {f"held_out.{k}.{name}": value for name, value in run.items()}
    write_arrays(folder / ARRAY_FILE, arrays)
    write_whole(folder / JSON_FILE, json.dumps(about, indent=1, allow_nan=False) + "\n")


def read_correction(folder: Path) -> Correction:
    """Of a report's folder.

    Raises:
        InputError: the report has none, or its files cannot be read.
    """
    path = folder / JSON_FILE
    if not is_file(path):
        raise InputError(
            f"{folder} has no {JSON_FILE}: nothing was named there, or the report is older than exports;"
            " diagnose again with --export"
        )
    about = parse_json(read_text(path, "the correction"), str(path))
    try:
        if about["schema"] != SCHEMA:
            raise InputError(
                f"{path} has schema {about['schema']}, must be {SCHEMA}; use the samrl that wrote it"
            )
        arrays = unpacked(read_whole(folder / ARRAY_FILE, MOST_BYTES), folder / ARRAY_FILE)
        law = about["law"]
        nominal = {name: np.array(about["nominal"][name]) for name in ("friction", "damping", "armature")}
        return Correction(
            effects=tuple(about["effects"]),
            joints=tuple(about["joints"]),
            fields={name: _array(value) for name, value in about["fields"].items()},
            unsimulated=tuple(about["unsimulated"]),
            urdf=about["urdf"],
            law=None if law is None else NominalLaw(**{k: _unlisted(v) for k, v in law.items()}),
            tool=about["tool"],
            promise=about["promise"],
            model=about["model"],
            samples=_below(arrays, "sample."),
            motion=_below(arrays, "motion."),
            held_out=tuple(_below(arrays, f"held_out.{k}.") for k in range(about["recordings"])),
            **nominal,
        )
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path} is no correction ({error!r}); diagnose again with --export") from error


def _below(arrays: dict[str, np.ndarray], prefix: str) -> dict[str, np.ndarray]:
    return {name.removeprefix(prefix): value for name, value in arrays.items() if name.startswith(prefix)}


def _listed(value: Any) -> Any:
    """Plain JSON; what is infinite becomes a word."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [_listed(v) for v in value]
    return "inf" if isinstance(value, float) and np.isinf(value) else value


def _unlisted(value: Any) -> Any:
    if isinstance(value, list):
        return tuple(_unlisted(v) for v in value)
    return float("inf") if value == "inf" else value


def _array(value: Any) -> np.ndarray:
    return np.array(_unlisted(value), dtype=float)
