"""Depth of a wall as depth cameras and data sets write it, by NumPy, Pillow and SciPy's rotations alone.

Noise grows with the square of the depth, a pattern of 0.04 % lasts, an edge and 3 % of the pixels are holes.
python -m tests.recordings.logs.depth_cameras DIR makes a folder for each case.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

WIDTH, HEIGHT, FX, FY, CX, CY = 320, 240, 302.0, 301.0, 158.3, 121.7
AT_M = (0.4, 0.6, 0.8, 1.1, 1.5, 2.0)
U, V = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
RAY = np.stack([(U - CX) / FX, (V - CY) / FY, np.ones(U.shape)], axis=2)
MATRIX = [[FX, 0.0, CX], [0.0, FY, CY], [0.0, 0.0, 1.0]]


def across(tilt: np.ndarray) -> np.ndarray:
    """Normal (3,) of a wall that leans by two angles [rad]."""
    normal = np.array([np.sin(tilt[1]), -np.sin(tilt[0]), 1.0])
    return normal / np.linalg.norm(normal)


def wall(
    rng: np.random.Generator, distance: float, normal: np.ndarray | None = None, factor: float = 0.0,
    offset: float = 0.0, square: float = 0.0, floor: bool = False,
) -> np.ndarray:  # fmt: skip
    """Depth (H, W) [m] as a camera reads it: (1 + factor) z + offset + square z^2; zero in holes."""
    z = distance / (RAY @ (across(np.array([0.03, -0.02])) if normal is None else normal))
    if floor:  # in front of the wall, below
        z[170:] = np.minimum(z[170:], 0.27 * distance / RAY[170:, :, 1])
    read = (1 + factor) * z * (1 + 4e-4 * np.sin(U / 37.0) * np.cos(V / 29.0)) + offset + square * z**2
    read += 0.0012 * z**2 * rng.standard_normal(z.shape)
    read[:, :14] = 0.0
    read[rng.uniform(size=z.shape) < 0.03] = 0.0
    return read


def save(path: Path, depth: np.ndarray, per_metre: float = 1000.0) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.round(per_metre * depth).astype(np.uint16)).save(path)


def make_realsense(folder: Path, factor: float, floor: bool = False) -> Path:
    """Folders named by the distance, millimetres, intrinsics with the SDK's names."""
    rng = np.random.default_rng(21)
    for distance in AT_M:
        for k in range(4):
            image = wall(rng, distance, factor=factor, floor=floor)
            save(folder / f"{1000 * distance:.0f}mm" / f"depth_{k:04d}.png", image)
    about = {"fx": FX, "fy": FY, "ppx": CX, "ppy": CY, "depth_scale": 0.001, "width": WIDTH}
    (folder / "intrinsics.json").write_text(json.dumps(about))
    return folder


def make_ros_dump(folder: Path, offset: float) -> Path:
    """Frames of a bag with a camera_info and a table of what the tape said, by image."""
    rng, rows = np.random.default_rng(22), ["image,tape_m"]
    for k, distance in enumerate(np.repeat(AT_M, 5)):
        save(folder / "depth" / f"{k:05d}.png", wall(rng, distance, offset=offset))
        rows.append(f"{k:05d}.png,{distance}")
    (folder / "distances.csv").write_text("\n".join(rows))
    numbers = [n for row in MATRIX for n in row]
    (folder / "camera_info.yaml").write_text(f"camera_matrix:\n  rows: 3\n  cols: 3\n  data: {numbers}\n")
    return folder


def make_tum(folder: Path, square: float) -> Path:
    """TUM RGB-D: 5000 a metre, `depth.txt`; poses of a board on the leaning wall as solvePnP gives them."""
    rng = np.random.default_rng(23)
    listed, poses = ["# depth maps", "# timestamp filename"], ["file,tx,ty,tz,rvec_x,rvec_y,rvec_z"]
    for k in range(40):
        distance, normal = rng.uniform(0.5, 2.2), across(rng.uniform(-0.3, 0.3, 2))
        name = f"{1305031453.3 + k / 3:.6f}"
        save(folder / "depth" / f"{name}.png", wall(rng, distance, normal, square=square), 5000.0)
        listed.append(f"{name} depth/{name}.png")
        place = distance * normal + np.cross(normal, rng.uniform(-0.2, 0.2, 3))
        axis = np.cross([0.0, 0.0, 1.0], normal)
        turn = axis / np.linalg.norm(axis) * np.arcsin(np.linalg.norm(axis))
        poses.append(f"{name}.png," + ",".join(f"{v:.6f}" for v in (*place, *turn)))
    for file, lines in (("depth.txt", listed), ("rgb.txt", ["# color"]), ("board.csv", poses)):
        (folder / file).write_text("\n".join(lines) + "\n")
    (folder / "K.txt").write_text("\n".join(" ".join(map(str, row)) for row in MATRIX))
    return folder


def make_board(folder: Path, factor: float, wall_m: float = 1.15) -> Path:
    """A leaning board of 300 x 220 mm before a wall that fills most of the image; poses by quaternions."""
    rng = np.random.default_rng(25)
    poses = ["file,tx,ty,tz,qx,qy,qz,qw"]
    for k in range(6):
        turned = Rotation.from_euler("xyz", rng.uniform(-0.3, 0.3, 3))
        place = np.array([*rng.uniform(-0.05, 0.05, 2), rng.uniform(0.5, 0.95)])
        normal = turned.as_matrix()[:, 2]
        z = (normal @ place) / (RAY @ normal)
        aside = np.abs((RAY * z[..., None] - place) @ turned.as_matrix()[:, :2])
        there = np.all(aside < [0.15, 0.11], axis=2)
        depth = np.where(there, wall(rng, normal @ place, normal, factor), wall(rng, wall_m, None, factor))
        save(folder / "depth" / f"{k:03d}.png", depth)
        poses.append(f"{k:03d}.png," + ",".join(f"{v:.6f}" for v in (*place, *turned.as_quat())))
    (folder / "board.csv").write_text("\n".join(poses) + "\n")
    (folder / "K.txt").write_text("\n".join(" ".join(map(str, row)) for row in MATRIX))
    return folder


def make_stack(folder: Path, factor: float) -> Path:
    """An array of metres with NaN in holes and a matrix; centimetres of a tape beside it."""
    folder.mkdir()
    rng, at = np.random.default_rng(24), np.repeat(AT_M, 4)
    images = np.stack([wall(rng, distance, factor=factor) for distance in at]).astype(np.float32)
    np.savez(folder / "run.npz", depth=np.where(images > 0, images, np.nan), K=np.array(MATRIX))
    np.savetxt(folder / "tape.csv", 100 * at, header="tape_cm", comments="", fmt="%.1f")
    return folder / "run.npz"


def make_depth_cameras(folder: Path) -> None:
    """A folder for each."""
    folder.mkdir(parents=True)
    make_realsense(folder / "realsense", 0.012)
    make_realsense(folder / "floor", -0.02, floor=True)
    make_realsense(folder / "right", 0.0)
    make_ros_dump(folder / "ros_dump", 0.006)
    make_tum(folder / "tum", 0.008)
    make_stack(folder / "stack", 0.015)


if __name__ == "__main__":
    make_depth_cameras(Path(sys.argv[1]))
