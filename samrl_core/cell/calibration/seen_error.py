"""How far a corrected cell may still show things from where they are: its covariance, carried to a place.

The covariance of a hand-eye or of two bases is of numbers that pull together: an arm's base may be known to
5 mm and 10 mrad and yet the place that it was seen over to half a millimetre. What a loop needs is the error
at a place and view, so the numbers' errors are carried there, to first order:

    hand-eye   a twist of the camera:      dp = R_flange t + R_camera (r x p_camera)
    bases      a twist of the tool's base: dp = -R^T t - r x p_base
    depth      along the viewing ray:      dz = -(z ds + do) / (1 + s)
    lens       across it, by the ray that another pinhole and Brown's polynomial give the same pixel.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from samrl_core.cell.calibration.cell_correction import (
    NO_CORRECTION,
    NUMBERS,
    CellCorrection,
    twist_names,
)
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.types.pose import Pose, rotation_vector

# Of `seen_map`: the camera's twist in its own axes, then the rest.
SEEN_ROWS = (*twist_names("camera"), *NUMBERS)
_WAY, _TURN = 0.05, 0.1  # of a camera whose errors are compared with those from here [m], [rad]


@dataclass(frozen=True, eq=False)
class SeenError:
    """What is left of a corrected cell's errors, as covariances and standard deviations."""

    place: np.ndarray  # (2, 2) of where a thing of known height is seen, x and y in world [m2]
    apart: np.ndarray  # (2, 2) of the same less that of a thing above it, as seen in one image [m2]
    position: np.ndarray  # (3, 3) of where a thing of unknown height is seen [m2]
    per_metre: float  # by which `place` changes with the camera's way [m/m]
    per_radian: float  # and with its turn [m/rad]


EXACTLY_SEEN = SeenError(np.zeros((2, 2)), np.zeros((2, 2)), np.zeros((3, 3)), 0.0, 0.0)


def seen_error(
    correction: CellCorrection, cell: CellSpec, camera_in_world: Pose, point: np.ndarray, above: np.ndarray
) -> SeenError:
    """The error of a correction at a view; none of one that is known exactly.

    Heights are known to the loop, so that an error along the viewing ray moves nothing and one upwards moves
    the place along the ray.

    Args:
        correction: with its covariance.
        cell: as described.
        camera_in_world: optical frame; above the points.
        point: (3,) in world, what is aimed at [m].
        above: (3,) in world, what is led there, where it is seen [m].
    """
    if not correction.covariance.of:
        return EXACTLY_SEEN
    factor = correction.covariance.factor

    def at(camera: Pose, one: np.ndarray) -> np.ndarray:
        columns = seen_columns(correction, cell, camera, one[None])[0] @ factor
        return _at_height(columns, one - camera.position)

    free = seen_columns(correction, cell, camera_in_world, point[None])[0] @ factor
    here, tip = at(camera_in_world, point), at(camera_in_world, above)
    ways = [Pose(camera_in_world.position + step, camera_in_world.quat_xyzw) for step in _WAY * np.eye(3)]
    turns = [camera_in_world @ rotation_vector(_TURN * axis) for axis in np.eye(3)]
    moved = [_variance(at(camera, point) - here) / _WAY**2 for camera in ways]
    turned = [_variance(at(camera, point) - here) / _TURN**2 for camera in turns]
    return SeenError(
        here @ here.T,
        (tip - here) @ (tip - here).T,
        free @ free.T,
        float(np.sqrt(np.mean(moved))),
        float(np.sqrt(np.mean(turned))),
    )


def seen_columns(
    correction: CellCorrection, cell: CellSpec, camera_in_world: Pose, points: np.ndarray
) -> np.ndarray:
    """How points (N, 3) in world are seen elsewhere per unit of the covariance's numbers (N, 3, K)."""
    seen = camera_in_world.inverse().apply(points)
    rows = seen_map(correction, cell, camera_in_world)
    of_row = dict(zip(SEEN_ROWS, rows[:, None, :], strict=True))
    x, y, z = (seen[:, axis, None] for axis in range(3))
    moved = np.stack(shifted(of_row, x, y, z, cell.intrinsics, correction), axis=1)  # (N, 3, K)
    return np.einsum("ij,njk->nik", camera_in_world.rotation, moved)


def seen_map(correction: CellCorrection, cell: CellSpec, camera_in_world: Pose) -> np.ndarray:
    """What one unit of each of the covariance's numbers is in the camera's axes (16, K), for `shifted`.

    Rows: translation and rotation by which what is seen moves, then `NUMBERS`.
    """
    whole = {name: np.zeros(len(SEEN_ROWS)) for name in correction.covariance.of}
    to_camera = camera_in_world.rotation.T
    eye = np.eye(3)
    blocks: list[tuple[str, np.ndarray]] = []
    if (hand := correction.camera_in_flange) is not None:
        blocks.append(("camera_in_flange", np.block([[hand.rotation.T, 0 * eye], [0 * eye, eye]])))
    if (bases := correction.tool_base_in_camera_base) is not None:
        tool = cell.tool_base_in_world
        turn = -to_camera @ tool.rotation  # of a rotation of the base, to what is seen in the camera's axes
        lever = to_camera @ (camera_in_world.position - tool.position)  # it turns about the base
        block = np.block([[turn @ bases.rotation.T, -_cross(lever) @ turn], [0 * eye, turn]])
        blocks.append(("tool_base_in_camera_base", block))
    for pose, block in blocks:
        for name, column in zip(twist_names(pose), block.T, strict=True):
            if name in whole:
                whole[name][:6] = column
    for name in NUMBERS:
        if name in whole:
            whole[name][SEEN_ROWS.index(name)] = 1.0
    return np.stack(list(whole.values()), axis=1) if whole else np.zeros((len(SEEN_ROWS), 0))


def shifted(
    by: Mapping[str, Any], x: Any, y: Any, z: Any, k: Intrinsics, correction: CellCorrection = NO_CORRECTION
) -> tuple[Any, Any, Any]:
    """By how much points in the camera's axes are seen elsewhere; arithmetic alone, for NumPy and torch.

    Args:
        by: errors by the rows of `seen_map`; broadcast against the points.
        x: of the points, right [m].
        y: down [m].
        z: forward [m].
        k: of the described camera.
        correction: whose errors these are.
    """
    tx, ty, tz, rx, ry, rz = (by[name] for name in SEEN_ROWS[:6])
    u, v = x / z, y / z
    square = u * u + v * v
    slope = 1.0 + correction.numbers.get("depth_scale", 0.0)
    along = -(by["depth_scale"] * z + by["depth_offset"]) / slope
    radial = by["k1"] * square + by["k2"] * square * square
    p1, p2 = by["p1"], by["p2"]
    du = u * (by["fx"] + radial) + k.width / k.fx * by["cx"] + 2.0 * p1 * u * v + p2 * (square + 2.0 * u * u)
    dv = v * (by["fy"] + radial) + k.height / k.fy * by["cy"] + p1 * (square + 2.0 * v * v) + 2.0 * p2 * u * v
    return (
        tx + ry * z - rz * y + along * u - du * z,
        ty + rz * x - rx * z + along * v - dv * z,
        tz + rx * y - ry * x + along,
    )


def _at_height(columns: np.ndarray, ray: np.ndarray) -> np.ndarray:
    """(2, K): x and y of columns (3, K) where a thing's height is known and the ray (3,) says the rest."""
    return columns[:2] - np.outer(ray[:2] / ray[2], columns[2])


def _variance(factor: np.ndarray) -> float:
    """Mean over the axes of F F' [m2]."""
    return 0.5 * float(np.square(factor).sum())


def _cross(v: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
