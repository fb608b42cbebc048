"""Calibration of a cell from recorded poses: what was found, how sure it is, as JSON and as a picture."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.cell.calibration.chain_of_poses import ChainSolution, influence, response, solve_chain
from samrl_core.cell.calibration.recorded_poses import (
    MAX_BYTES,
    BaseFile,
    HandEyeFile,
    Kind,
    base_pairs,
    change_with_camera,
    hand_eye_pairs,
    read_recorded,
)
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError, SolveError
from samrl_core.common.figure_file import save_figure
from samrl_core.common.files import read_whole, write_whole

SCHEMA = 1
FOUND = {"hand_eye": "camera_in_flange", "base_to_base": "tool_base_in_camera_base"}
ALSO = {"hand_eye": "board_in_base", "base_to_base": "board_in_flange"}


@dataclass(frozen=True, eq=False)
class CalibratedPose:
    """A calibrated pose.

    `influence` (N, 6) is how far it moves without one of the pairs: position in the parent's axes [m],
    rotation in the child's axes [rad].
    """

    kind: Kind
    pose: Pose  # camera in flange, or tool arm's base in the camera arm's
    board: Pose  # board in base, or board in the tool arm's flange
    residual_m: np.ndarray  # (N,) [m]
    residual_rad: np.ndarray  # (N,) [rad]
    influence: np.ndarray
    camera_in_flange: Pose  # found, or taken from the hand-eye file
    inherited: np.ndarray  # (6, 6) covariance that comes with the hand-eye calibration, zero for one

    @property
    def covariance(self) -> np.ndarray:
        """(6, 6) of position [m] and rotation [rad]."""
        return self.influence.T @ self.influence + self.inherited


@dataclass(frozen=True, eq=False)
class HandEyePose:
    """Result of a hand-eye calibration, read back."""

    camera_in_flange: Pose
    covariance: np.ndarray  # (6, 6) as of `CalibratedPose`


def calibrate(pairs_file: Path, hand_eye: Path | None) -> CalibratedPose:
    """Calibrate from a file of pairs.

    Args:
        pairs_file: as `read_recorded` reads it.
        hand_eye: result of a hand-eye calibration; base-to-base calibration needs it, hand-eye takes none.

    Raises:
        InputError: a file that does not fit, too few pairs, or too little rotation.
        SolveError: the pairs contradict each other.
    """
    recorded = read_recorded(pairs_file)
    if isinstance(recorded, HandEyeFile):
        if hand_eye is not None:
            raise InputError(f"{pairs_file} is for hand-eye calibration, which takes no --hand-eye")
        solve = partial(_camera, recorded)
    elif hand_eye is None:
        raise InputError(
            f"{pairs_file} is for base-to-base calibration: give --hand-eye FILE, the result of a "
            "hand-eye calibration"
        )
    else:
        solve = partial(_base, recorded, read_hand_eye(hand_eye))
    try:
        return solve()
    except (InputError, SolveError) as error:
        raise type(error)(f"{pairs_file}: {error}") from error


def _camera(recorded: HandEyeFile) -> CalibratedPose:
    pairs = hand_eye_pairs(recorded)
    solution = solve_chain(pairs)
    _, moved = influence(pairs, solution)
    board = solution.outer.inverse()
    return _calibration("hand_eye", solution, board, moved, solution.inner, np.zeros((6, 6)))


def _base(recorded: BaseFile, known: HandEyePose) -> CalibratedPose:
    pairs = base_pairs(recorded, known.camera_in_flange)
    solution = solve_chain(pairs)
    moved, _ = influence(pairs, solution)
    slope, _ = response(pairs, solution, change_with_camera(recorded, known.camera_in_flange))
    inherited = slope @ known.covariance @ slope.T
    return _calibration("base_to_base", solution, solution.inner, moved, known.camera_in_flange, inherited)


def _calibration(
    kind: Kind, solution: ChainSolution, board: Pose, moved: np.ndarray, camera: Pose, inherited: np.ndarray
) -> CalibratedPose:
    pose = solution.inner if kind == "hand_eye" else solution.outer
    return CalibratedPose(
        kind, pose, board, solution.residual_m, solution.residual_rad, moved, camera, inherited
    )


def read_hand_eye(path: Path) -> HandEyePose:
    """Result of a hand-eye calibration by `write_calibration`. Raises InputError."""
    data = read_result(path, "hand_eye")
    try:
        covariance = np.array(data.get("covariance"), dtype=np.float64)
    except (ValueError, TypeError, OverflowError) as error:
        raise InputError(f"{path} has no covariance of 6x6 numbers ({error}); calibrate anew") from error
    if covariance.shape != (6, 6) or not np.isfinite(covariance).all():
        raise InputError(f"{path} has no covariance of 6x6 finite numbers; calibrate anew")
    return HandEyePose(pose_of(data, FOUND["hand_eye"], path), covariance)


def calibrated_cell(cell: CellSpec, hand_eye: Path | None, bases: Path | None) -> CellSpec:
    """A cell with its camera and the camera arm's base where calibrations have found them.

    The tool arm's base stays: it is the world's origin in every task.

    Raises:
        InputError: a file that is no such calibration.
    """
    if hand_eye is not None:
        cell = replace(cell, camera_in_flange=read_hand_eye(hand_eye).camera_in_flange)
    if bases is not None:
        tool_in_camera = pose_of(read_result(bases, "base_to_base"), FOUND["base_to_base"], bases)
        cell = replace(cell, camera_base_in_world=cell.tool_base_in_world @ tool_in_camera.inverse())
    return cell


def read_result(path: Path, kind: Kind) -> dict[str, Any]:
    """A `calibration.json` of a kind. Raises InputError."""
    try:
        data = json.loads(read_whole(path, MAX_BYTES).decode())
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is no JSON ({error}); make one with samrl calibrate") from error
    found = data.get("kind") if isinstance(data, dict) else None
    if found != kind:
        raise InputError(f"{path} is of kind {found!r}, needed is {kind}; make one with samrl calibrate")
    return data


def pose_of(data: dict[str, Any], name: str, path: Path) -> Pose:
    """A pose of a `calibration.json`. Raises InputError."""
    try:
        entry = data[name]
        return Pose(np.array(entry["position"], dtype=float), np.array(entry["quat_xyzw"], dtype=float))
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: {name} is no pose ({error!r}); calibrate anew") from error


def as_json(found: CalibratedPose, pairs_file: Path) -> dict[str, Any]:
    """Contents of `calibration.json`; lengths in metres, angles in radians."""
    deviation = np.sqrt(np.diag(found.covariance))
    data: dict[str, Any] = {
        "schema": SCHEMA,
        "kind": found.kind,
        FOUND[found.kind]: _entry(found.pose),
        ALSO[found.kind]: _entry(found.board),
        "standard_deviation": {"position": deviation[:3].tolist(), "rotation": deviation[3:].tolist()},
        "covariance": found.covariance.tolist(),
        "residual_rms": {"position": _rms(found.residual_m), "rotation": _rms(found.residual_rad)},
        "residuals": {"position": found.residual_m.tolist(), "rotation": found.residual_rad.tolist()},
        "pairs": len(found.residual_m),
        "source": {
            "file": pairs_file.name,
            "sha256": hashlib.sha256(read_whole(pairs_file, MAX_BYTES)).hexdigest(),
        },
    }
    if found.kind == "base_to_base":
        data["camera_in_flange"] = _entry(found.camera_in_flange)
    return data


def write_calibration(found: CalibratedPose, pairs_file: Path, out: Path) -> None:
    """`calibration.json` and `calibration.png` into a folder. Raises InputError if it cannot be written."""
    try:
        _plot(found, out)
        text = json.dumps(as_json(found, pairs_file), indent=1) + "\n"
        write_whole(out / "calibration.json", text)
    except OSError as error:
        raise InputError(f"cannot write to {out} ({error.strerror}); give another --out") from error


def _plot(found: CalibratedPose, out: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3.2), layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    index = np.arange(len(found.residual_m))
    for axes, values, unit in (
        (left, 1e3 * found.residual_m, "mm"),
        (middle, np.rad2deg(found.residual_rad), "deg"),
    ):
        axes.bar(index, values)
        axes.axhline(_rms(values), color="black", linewidth=1, label=f"rms {_rms(values):.2f} {unit}")
        axes.set(xlabel="pair", ylabel=f"residual [{unit}]")
        axes.legend()
    for k, name in enumerate("xyz"):
        right.plot(index, 1e3 * found.influence[:, k], ".-", linewidth=0.5, label=name)
    right.set(xlabel="pair left out", ylabel="moves the position by [mm]", title=FOUND[found.kind])
    right.legend()
    out.mkdir(parents=True, exist_ok=True)
    save_figure(figure, out / "calibration.png", dpi=120)


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _entry(pose: Pose) -> dict[str, list[float]]:
    return {"position": pose.position.tolist(), "quat_xyzw": pose.quat_xyzw.tolist()}
