"""What was named of an arm, put into its own description: a URDF, and all values with their covariance.

The URDF holds what a URDF can: friction, damping, effort limits, inertias and zeros of joints. Whoever reads
the arm's URDF then has them too, the diagnosis first: with it the same machine has no gap. All that was named
stands in `arm.json` with its posterior covariance; what no URDF holds is a sentence.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.common.files import is_there, write_whole
from samrl_core.diagnosis.export.correction import BODY, Correction
from samrl_core.diagnosis.export.statement import EXACT, NEAREST, Statement
from samrl_core.diagnosis.export.to_urdf import to_urdf
from samrl_core.diagnosis.simulation.plant_parameters import joint_fields

SCHEMA = 1
URDF_FILE, VALUES_FILE = "arm.urdf", "arm.json"
BODY_PARAMETERS = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")  # about the joint's frame


@dataclass(frozen=True)
class AppliedModel:
    """What was written, what it says and what it does not."""

    files: tuple[Path, ...]
    inside: tuple[Statement, ...]  # in the URDF, exactly or as near as it can be
    outside: tuple[Statement, ...]  # for the user's own code
    unsimulated: tuple[str, ...]  # effects for which no number of a model stands


def write_applied_model(correction: Correction, folder: Path) -> AppliedModel:
    """`arm.urdf` and `arm.json` into a new folder.

    Raises:
        InputError: the recordings have no URDF, it lacks a joint, or the folder exists.
    """
    if not correction.urdf:
        raise InputError("the recordings hold no URDF that could be corrected; give --urdf FILE")
    if is_there(folder):
        raise InputError(f"{folder} exists already; move it away, what was applied is not replaced")
    text, said = to_urdf(correction, correction.urdf)
    folder.mkdir(parents=True)
    write_whole(folder / URDF_FILE, text)
    write_whole(folder / VALUES_FILE, json.dumps(values_of(correction), indent=1, allow_nan=False) + "\n")
    inside = tuple(s for s in said if s.how in (EXACT, NEAREST))
    unsimulated = set(correction.unsimulated)  # told apart
    outside = tuple(s for s in said if s.how not in (EXACT, NEAREST) and s.what not in unsimulated)
    files = (folder / URDF_FILE, folder / VALUES_FILE)
    return AppliedModel(files, inside, outside, correction.unsimulated)


def values_of(correction: Correction) -> dict[str, Any]:
    """Changed numbers as differences from the nominal model, with the covariance of all of them together."""
    c, neutral = correction, joint_fields()
    entries: list[dict[str, Any]] = []
    columns: list[np.ndarray] = []
    for name, value in c.fields.items():
        samples = c.samples.get(name)
        default = float(neutral[name]["default"]) if name in neutral else None
        for index in np.ndindex(value.shape):
            if float(value[index]) == default if default is not None else value[index] == 0.0:
                continue
            if not np.isfinite(value[index]):
                continue
            entries.append({"field": name, **_where(c, name, index), "value": float(value[index])})
            drawn = None if samples is None else samples[(slice(None), *index)]
            there = drawn is not None and len(drawn) > 1 and bool(np.isfinite(drawn).all())
            columns.append(drawn if there and drawn is not None else np.zeros(2))
    longest = max((len(column) for column in columns), default=2)
    known = [len(column) == longest and longest > 2 for column in columns]
    table = np.array([column if k else np.zeros(longest) for column, k in zip(columns, known, strict=True)])
    covariance = np.atleast_2d(np.cov(table)) if entries else np.zeros((0, 0))
    for entry, k, variance in zip(entries, known, np.diag(covariance), strict=True):
        entry["standard_deviation"] = float(np.sqrt(variance)) if k else None
    return {
        "schema": SCHEMA, "effects": c.effects, "values": entries, "covariance": covariance.tolist(),
        "unsimulated": c.unsimulated, "held_out_shrink": c.promise.get("shrink"),
    }  # fmt: skip


def _where(c: Correction, name: str, index: tuple[int, ...]) -> dict[str, str]:
    if name == BODY:
        return {"joint": c.joints[index[0]], "parameter": BODY_PARAMETERS[index[1]]}
    if name in joint_fields():
        return {"joint": c.joints[index[0]], "unit": joint_fields()[name]["unit"]}
    return {"parameter": ",".join(str(i) for i in index)}
