"""Tracks of bodies in other frames and of other motions, by NumPy alone.

    python -m tests.recordings.logs.foreign_bodies OUT

Tosses and slides whose z points down or whose y points up, balls and cylinders that roll down an incline that
is stated, a block that slides on it, and a box that is pushed as MIT's planar pushing data have it.
"""

from __future__ import annotations

import sys
from pathlib import Path

import h5py
import numpy as np
import yaml

G, NOISE_M, SEED = 9.81, 4e-4, 11
SLOPE = np.deg2rad(15.0)
NED, Y_UP = np.diag([1.0, -1.0, -1.0]), np.array([[1.0, 0, 0], [0, 0, 1.0], [0, 1.0, 0]])


def write_table(path: Path, **columns: np.ndarray) -> None:
    """A CSV file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    header = ",".join(columns)
    np.savetxt(
        path, np.column_stack(list(columns.values())), delimiter=",", header=header, comments="", fmt="%.6f"
    )


def toss(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Time (N,) [s] and positions (N, 3) [m] of a flight, z up."""
    time = np.arange(60) / 100.0
    speed = np.array([*rng.uniform(-1, 1, 2), rng.uniform(2.0, 2.8)])
    path = time[:, None] * speed - 0.5 * G * np.outer(time**2, [0, 0, 1])
    return time, path + 5e-4 * rng.standard_normal(path.shape)


def slide(rng: np.random.Generator, friction: float = 0.3) -> tuple[np.ndarray, np.ndarray]:
    """Likewise of a slide to rest on a level plane."""
    time, way = np.arange(140) / 100.0, rng.uniform(0, 2 * np.pi)
    moving = np.minimum(time, 1.5 / (friction * G))
    gone = 1.5 * moving - 0.5 * friction * G * moving**2
    path = np.outer(gone, [np.cos(way), np.sin(way), 0.0]) + [0, 0, 0.02]
    return time, path + NOISE_M * rng.standard_normal(path.shape)


def descend(
    rng: np.random.Generator, share: float, friction: float, up: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Time and positions (N, 2) along an incline, x downhill; `share` of the pull moves the body forward."""
    step, every = 1e-4, 83
    velocity = np.array([-1.6 if up else 0.2, rng.uniform(-0.4, 0.4)])
    place, path = np.zeros(2), []
    for k in range(144 * every):
        if k % every == 0:
            path.append(place.copy())
        pull = np.array([share * G * np.sin(SLOPE), 0.0])
        brake = friction * G * np.cos(SLOPE) * velocity / max(float(np.hypot(*velocity)), 1e-9)
        velocity = velocity + step * (pull - brake)
        place = place + step * velocity
    return step * every * np.arange(144), np.array(path) + NOISE_M * rng.standard_normal((144, 2))


def write_incline(folder: Path, rng: np.random.Generator, share: float, friction: float, both: bool,
                  stated: float) -> None:  # fmt: skip
    """Six motions and the mapping of somebody who takes the body for one that slides."""
    for k in range(6):
        time, path = descend(rng, share, friction, both and k % 2 == 1)
        write_table(folder / f"r{k}.csv", t=time, x=path[:, 0], y=path[:, 1])
    track = {"position": ["x", "y"], "axes": "xy"}
    content = {
        "sources": {"t": {"time": {"column": "t"}, "columns": {"x": "x", "y": "y"}}},
        "bodies": {"track": track, "support": {"friction": stated}, "incline": 15},
        "recordings": [{"glob": "*.csv", "hold_out_every": 3}],
    }
    (folder / "mapping.yaml").write_text(yaml.safe_dump(content))


def write_push(path: Path, rng: np.random.Generator) -> None:
    """A box that a tip pushes: arrays of time, x, y and angle, and a wrench."""
    time = 1.46e9 + np.arange(400) / 250.0
    s = time - time[0]
    box = np.stack([time, 0.3 + 0.05 * s, 0.002 * s, 0.3 * s], axis=1)
    box[:, 1:3] += 2e-4 * rng.standard_normal((400, 2))
    path.parent.mkdir(parents=True, exist_ok=True)
    with h5py.File(path, "w") as file:
        file["tip_pose"] = np.stack([time, 0.25 + 0.05 * s, 0 * s, 0 * s], axis=1)
        file["object_pose"] = box
        file["ft_wrench"] = np.column_stack([time, rng.normal([2.0, 0.0, 0.0], 0.1, (400, 3))])


def write_all(out: Path) -> None:
    """A folder for each log."""
    rng = np.random.default_rng(SEED)
    for name, frame in (("ned", NED), ("y_up", Y_UP)):
        for kind, make in (("tosses", toss), ("slides", slide)):
            for k in range(6):
                time, path = make(rng)
                x, y, z = (path @ frame.T).T
                write_table(out / f"{name}_{kind}" / f"t{k}.csv", t=time, x=x, y=y, z=z)
    write_incline(out / "ball_up_and_down", rng, 5 / 7, 0.004, True, 0.3)
    write_incline(out / "ball_down", rng, 5 / 7, 0.004, False, 0.3)
    write_incline(out / "cylinder_down", rng, 2 / 3, 0.004, False, 0.3)
    write_incline(out / "block", rng, 1.0, 0.2, True, 0.1)
    write_push(out / "pushed" / "push.h5", rng)


if __name__ == "__main__":
    write_all(Path(sys.argv[1]))
