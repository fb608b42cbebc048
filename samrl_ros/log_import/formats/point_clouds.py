"""Point clouds of a plane as depth images, so that a folder of clouds is read as one of images is.

A cloud holds each point's ray, so no intrinsics are asked for: it is put into the pixels of one wide and
coarse camera, each of which takes the point nearest to its middle.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from samrl_core.common.errors import InputError
from samrl_ros.log_import.formats.intrinsics import Intrinsics
from samrl_ros.log_import.formats.pcd_file import read_pcd

SUFFIXES = (".ply", ".pcd")
WIDTH, HEIGHT = 64, 48
CAMERA = Intrinsics(32.0, 32.0, 0.5 * (WIDTH - 1), 0.5 * (HEIGHT - 1))  # 90 degrees wide
LEAST_POINTS = 500
AHEAD = 0.9  # of the points that are on one side of the sensor


def read_cloud(file: Path, where: str) -> np.ndarray:
    """Raw depth (HEIGHT, WIDTH) of a cloud in the frame of its sensor, zero where it has no point.

    The z axis points forward, or backward as OpenGL's and the clouds of RealSense's viewer: turned about x.

    Raises:
        InputError: it cannot be read, holds too few points, or they lie on both sides of the sensor.
    """
    points = _points(file, where)
    ahead = float((points[:, 2] > 0).mean())
    if not AHEAD < max(ahead, 1.0 - ahead):
        raise InputError(
            f"{where}: {file.name} has points before and behind its origin ({ahead:.0%} with z > 0); give the"
            " cloud in the frame of its sensor, z forward"
        )
    if ahead < AHEAD:
        points = points * [1.0, -1.0, -1.0]
    points = points[points[:, 2] > 0]
    column = CAMERA.cx + CAMERA.fx * points[:, 0] / points[:, 2]
    row = CAMERA.cy + CAMERA.fy * points[:, 1] / points[:, 2]
    middle = np.stack([np.round(row), np.round(column)], axis=1).astype(int)
    seen = ((middle >= 0) & (middle < [HEIGHT, WIDTH])).all(axis=1)
    off = np.hypot(row - middle[:, 0], column - middle[:, 1])
    order = np.flatnonzero(seen)[
        np.argsort(-off[seen], kind="stable")
    ]  # the nearest to the middle comes last
    image = np.zeros((HEIGHT, WIDTH))
    image[middle[order, 0], middle[order, 1]] = points[order, 2]
    return image


def _points(file: Path, where: str) -> np.ndarray:
    points = read_pcd(file, where) if file.suffix.lower() == ".pcd" else _load_ply(file, where)
    points = points[np.isfinite(points).all(axis=1) & (points != 0.0).any(axis=1)]
    if len(points) < LEAST_POINTS:
        raise InputError(f"{where}: {file.name} has {len(points)} points; a plane needs {LEAST_POINTS}")
    return points


def _load_ply(file: Path, where: str) -> np.ndarray:
    import trimesh  # half a second, for clouds alone

    try:
        cloud = trimesh.load(str(file), process=False)
        return np.asarray(getattr(cloud, "vertices", np.zeros((0, 3))), dtype=float)
    except Exception as error:  # whatever a damaged file raises there
        raise InputError(f"{where}: {file.name} cannot be read as a cloud of points: {error}") from error
