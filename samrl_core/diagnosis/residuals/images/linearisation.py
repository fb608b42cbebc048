"""The point about which rows are linear: not the stated cell, but what the fitted images look like.

A shift of outlines by more than their blur is not linear, and edges of a model that stands elsewhere hide
pixels that could be compared. So all that may be off is fitted together, robustly, the scene is rendered
there, and rows are taken anew. What came of it is no claim of a cause: which of several errors it is, is open
in it. A row is y = r + J p, with residual r and columns J at the point p, so that it stays linear in errors
counted from the stated cell.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from samrl_core.diagnosis.residuals.images.flows import flows
from samrl_core.diagnosis.residuals.images.noise import fitted_errors
from samrl_core.diagnosis.residuals.images.rows import CHANNELS, ComparedFrame, Rows, frame_rows, joined
from samrl_core.diagnosis.residuals.images.scene import FrameGeometry, ImageScene
from samrl_core.diagnosis.residuals.poses import rigid

ROUNDS = 3
SMALL_PX = 0.15  # a step that moves outlines no further ends the rounds
Point = Mapping[str, np.ndarray]  # name of a flow -> amplitudes (p,)
OF_CAMERA = ("hand_eye", "base", "camera_zeros", "camera_late")  # move every point in the camera's axes


@dataclass(frozen=True, eq=False)
class Displaced:
    """A frame's scene with errors applied."""

    view: FrameGeometry
    vertices: np.ndarray  # (V, 3) in the camera's axes


def displaced(scene: ImageScene, view: FrameGeometry, object_pose: np.ndarray, point: Point) -> Displaced:
    """Geometry and vertices with the errors of a point applied: the camera's exactly, the others as flows."""
    if not point:
        return Displaced(view, scene.vertices(view, object_pose))
    object_at = scene.origin + object_pose[:3, 3]
    middle = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    moves = flows(scene, view, middle, np.zeros(4, dtype=int), object_at)
    shifts = sum(np.einsum("p,pni->ni", point[n], moves[n]) for n in OF_CAMERA if n in point)
    moved = replace(view, camera=view.camera @ rigid.inverse(rigid.exp(_twist(shifts))[0][None])[0])
    vertices = scene.vertices(moved, object_pose)
    own = flows(scene, moved, vertices, scene.group, object_at)
    out = vertices.copy()
    for name, amplitudes in point.items():
        if name in own and name not in OF_CAMERA:
            out += np.einsum("p,pni->ni", amplitudes, own[name])
    return Displaced(moved, out)


def _twist(shifts: np.ndarray | int) -> np.ndarray:
    """Twist (6,) whose displacements of the origin and the three unit points are `shifts` (4, 3)."""
    d = np.zeros((4, 3)) if isinstance(shifts, int) else shifts
    x, y, z = d[1:] - d[0]  # w x e_i
    return np.concatenate([d[0], [y[2], z[0], x[1]]])


def rows_at(
    scene: ImageScene, frame: ComparedFrame, object_pose: np.ndarray, noise_per_z2: float, point: Point
) -> dict[str, Rows]:
    """Rows of every channel, linear about a point and counted from the stated cell."""
    at = displaced(scene, frame.view, object_pose, point)
    made = frame_rows(scene, replace(frame, view=at.view), object_pose, noise_per_z2, at.vertices)
    if not point:
        return made
    return {channel: replace(r, value=r.value + _moved_by(r, point)) for channel, r in made.items()}


def linearised(
    scene: ImageScene, frames: Sequence[ComparedFrame], object_pose: np.ndarray, noise_per_z2: float
) -> dict[str, np.ndarray]:
    """The point at which the rendered scene looks like the frames."""
    point: dict[str, np.ndarray] = {}
    for _ in range(ROUNDS):
        made = [rows_at(scene, f, object_pose, noise_per_z2, point) for f in frames]
        rows = {c: joined([m[c] for m in made]) for c in CHANNELS}
        found = fitted_errors({c: r for c, r in rows.items() if len(r.value)})
        before = point
        point = {name: value for name, value in found.items() if name in FLOWS}
        step = {n: v - before.get(n, np.zeros(len(v))) for n, v in point.items()}
        outline = rows["mask"]
        if not len(outline.value) or float(np.sqrt(np.mean(_moved_by(outline, step) ** 2))) < SMALL_PX:
            break
    return point


def _moved_by(rows: Rows, point: Point) -> np.ndarray:
    out = np.zeros(len(rows.value))
    for name, amplitudes in point.items():
        if name in rows.columns:
            out = out + amplitudes @ rows.columns[name]
    return out


# A lens' distortion is left out: between the vertices of large triangles it is not linear.
FLOWS = (
    *OF_CAMERA, "tool_zeros", "tool_late", "held", "object", "object_scale", "focal", "centre",
)  # fmt: skip
