"""What a diagnosis of poses changes in a calibration: transforms with covariances, and shifts of stamps.

A transform is written as `samrl cell --hand-eye` and `--bases` read it (`calibration.json`) and as the lines
of a mapping; all that a cell can put right is in one file for `samrl cell --correction` (`cell.json`). The
rest is a statement for the user's own code.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.cell.calibration.cell_correction import (
    CellCorrection,
    CorrectionCovariance,
    twist_names,
    write_correction,
)
from samrl_core.cell.types.pose import Pose
from samrl_core.common.files import write_whole

SCHEMA = 1
FILE, LINES, CELL = "calibration.json", "corrected.yaml", "cell.json"


@dataclass(frozen=True, eq=False)
class CorrectedTransform:
    """A constant transform of the chain, as it was stated and as it was found."""

    effect: str  # family@place
    name: str  # in a mapping: camera_in_flange, target_in_base, ...
    stated: Pose
    found: Pose
    covariance: np.ndarray  # (6, 6) of position in the parent's axes [m] and rotation in the child's [rad]
    calibration: tuple[str, str] | None  # kind and key of a `calibration.json`, if a cell has this transform

    @property
    def deviation(self) -> np.ndarray:
        """Standard deviations (6,) [m], [rad]."""
        return np.sqrt(np.diag(self.covariance))


@dataclass(frozen=True)
class Advice:
    """A correction that no transform of the chain holds."""

    effect: str
    says: str


@dataclass(frozen=True, eq=False)
class Recalibration:
    """All corrections of one diagnosis of poses."""

    camera: str
    transforms: tuple[CorrectedTransform, ...]
    statements: tuple[Advice, ...]
    sources: tuple[tuple[str, str], ...]  # (file, sha256) of the recordings that were fitted
    numbers: Mapping[str, float] = field(default_factory=dict[str, float])  # of depth and lens, of NUMBERS
    known: tuple[tuple[tuple[str, ...], np.ndarray], ...] = ()  # numbers found together, their covariance
    of_numbers: tuple[str, ...] = ()  # `family@place` that they come from
    refused: tuple[Advice, ...] = ()  # found, but nothing that a cell puts right, and why
    zeros: Mapping[str, Mapping[str, float]] = field(default_factory=dict[str, Mapping[str, float]])
    # what a joint reads too much [rad], by arm's role and joint
    of_zeros: tuple[str, ...] = ()  # `family@place` that they come from

    @property
    def cell(self) -> CellCorrection:
        """All of it that a cell can put right where its sensors come in; may be empty."""
        poses = {t.calibration[1]: t for t in self.transforms if t.calibration is not None}
        effects = (*(t.effect for t in poses.values()), *self.of_numbers, *self.of_zeros)
        found = {name: t.found for name, t in poses.items()}
        of_poses = ((twist_names(name), t.covariance) for name, t in poses.items())
        covariance = CorrectionCovariance.of_blocks((*of_poses, *self.known))
        return CellCorrection(
            **found, numbers=self.numbers, effects=effects, covariance=covariance, encoder_zeros=self.zeros
        )


def write_recalibration(found: Recalibration, folder: Path) -> list[Path]:
    """A folder with `calibration.json` for each transform of a cell, `corrected.yaml` with all lines, and
    `cell.json` where a cell can put something right.
    """
    written: list[Path] = []
    if not found.cell.is_empty:
        write_correction(folder / CELL, found.cell)
        written.append(folder / CELL)
    for t in found.transforms:
        if t.calibration is not None:
            path = folder / t.calibration[0] / FILE
            write_whole(path, json.dumps(_calibration_json(t, found), indent=1, allow_nan=False) + "\n")
            written.append(path)
    write_whole(folder / LINES, _lines(found))
    return [*written, folder / LINES]


def _calibration_json(t: CorrectedTransform, found: Recalibration) -> dict[str, Any]:
    assert t.calibration is not None
    kind, key = t.calibration
    deviation = t.deviation
    return {
        "schema": SCHEMA,
        "kind": kind,
        key: {"position": t.found.position.tolist(), "quat_xyzw": t.found.quat_xyzw.tolist()},
        "standard_deviation": {"position": deviation[:3].tolist(), "rotation": deviation[3:].tolist()},
        "covariance": t.covariance.tolist(),
        "effect": t.effect,
        "stated": {"position": t.stated.position.tolist(), "quat_xyzw": t.stated.quat_xyzw.tolist()},
        "sources": [{"file": file, "sha256": digest} for file, digest in found.sources],
    }


def _lines(found: Recalibration) -> str:
    out = [f"# What differs from the description of {found.camera}; one standard deviation behind each line."]
    if found.transforms:
        out += ["# In the mapping, in place of what is stated there:", "poses:"]
    for t in found.transforms:
        position = ", ".join(f"{v:.6f}" for v in t.found.position)
        quaternion = ", ".join(f"{v:.7f}" for v in t.found.quat_xyzw)
        moved = ", ".join(f"{1e3 * s:.2f}" for s in t.deviation[:3])
        turned = ", ".join(f"{np.rad2deg(s):.3f}" for s in t.deviation[3:])
        out += [
            f"  # {t.effect}: {moved} mm; {turned} deg",
            f"  {t.name}: {{position: [{position}], quaternion: [{quaternion}]}}",
        ]
    out += [f"# {s.effect}: {s.says}" for s in found.statements]
    out += [f"# Not in {CELL}: {s.effect}: {s.says}" for s in found.refused]
    return "\n".join(out) + "\n"
