"""The point about which rows are linear: not the stated cell, but what the fitted images look like.

A shift of outlines by more than their blur is not linear, and edges of a model that stands elsewhere hide
pixels that could be compared. So what may be off is fitted together, one error of it beyond tolerance, the
scene is rendered there, and rows are taken anew. What came of it names no cause: all errors stay open. A row
is y = r + J p, with residual r and columns J at the point p, so that it stays linear in errors counted from
the stated cell. A lens moves pixels: the recorded image is resampled to the stated pinhole, the scene stays.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy import linalg

from samrl_core.cell.calibration.cell_correction import LensPlaces, find_lens_places
from samrl_core.cell.types.image_recording import ImageTolerances
from samrl_core.diagnosis.residuals.images.flows import flows
from samrl_core.diagnosis.residuals.images.noise import FREE as WIDE
from samrl_core.diagnosis.residuals.images.noise import noise_of_rows
from samrl_core.diagnosis.residuals.images.rows import (
    CHANNELS,
    UNSEEN,
    ComparedFrame,
    Rows,
    frame_rows,
    joined,
)
from samrl_core.diagnosis.residuals.images.scene import FrameGeometry, ImageScene
from samrl_core.diagnosis.residuals.images.spreads import stated_spreads
from samrl_core.diagnosis.residuals.poses import rigid

ROUNDS = 3
SMALL = {"depth": 2e-4, "mask": 0.15}  # [m], [px]: a step that moves no more ends the rounds
BEYOND = 24.0  # [nat] that an error beyond tolerance needs; tiles are hardly independent of their neighbours
LEAST_LENS_PX = 1.0  # root mean square over the image, from which on a lens is taken out by resampling
Point = Mapping[str, np.ndarray]  # name of a flow -> amplitudes (p,)
OF_CAMERA = ("hand_eye", "base", "camera_zeros", "camera_late")  # move every point in the camera's axes
OF_LENS = {  # names of their amplitudes, as a cell's correction has them
    "focal": ("fx", "fy"), "centre": ("cx", "cy"), "radial": ("k1", "k2"), "tangential": ("p1", "p2"),
}  # fmt: skip


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
        if name in own and name not in (*OF_CAMERA, *OF_LENS):
            out += np.einsum("p,pni->ni", amplitudes, own[name])
    return Displaced(moved, out)


def undistorted(scene: ImageScene, frame: ComparedFrame, point: Point) -> ComparedFrame:
    """The frame as the stated lens would have seen it, if the true one is off by what a point says."""
    if not any(name in point for name in OF_LENS):
        return frame
    at = _places(scene, point)
    color = cv2.remap(frame.color, at.x, at.y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    depth = np.where(at.inside, frame.depth[at.row, at.column], np.nan)
    mask = np.where(at.inside, frame.mask[at.row, at.column], UNSEEN)
    beside = np.stack([at.x - at.column, at.y - at.row])
    return replace(frame, color=color, depth=depth, mask=mask, beside=beside)


def _places(scene: ImageScene, point: Point) -> LensPlaces:
    """Where the true lens has what the stated one has at each pixel."""
    numbers = {
        key: float(value)
        for name, keys in OF_LENS.items()
        for key, value in zip(keys, point.get(name, ()), strict=False)
    }
    return find_lens_places(numbers, scene.intrinsics)


def _without_small_lens(scene: ImageScene, point: Point) -> dict[str, np.ndarray]:
    """The point, its lens left out where that is off by less than a pixel (root mean square).

    Resampled labels are those of the nearest pixel: what is smaller is nearer by its columns.
    """
    at = _places(scene, point)
    v, u = np.mgrid[0 : scene.intrinsics.height, 0 : scene.intrinsics.width]
    shift = np.sqrt(np.mean((at.x - u) ** 2 + (at.y - v) ** 2))
    return {name: value for name, value in point.items() if shift > LEAST_LENS_PX or name not in OF_LENS}


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
    seen = replace(undistorted(scene, frame, point), view=at.view)
    made = frame_rows(scene, seen, object_pose, noise_per_z2, at.vertices)
    if not point:
        return made
    return {channel: replace(r, value=r.value + _moved_by(r, point)) for channel, r in made.items()}


def linearised(
    scene: ImageScene,
    frames: Sequence[ComparedFrame],
    object_pose: np.ndarray,
    noise_per_z2: float,
    stated: ImageTolerances,
    together: Sequence[str] = (),
) -> dict[str, np.ndarray]:
    """The point at which the rendered scene looks like the frames; `together` as for `most_probable`."""
    point: dict[str, np.ndarray] = {}
    for _ in range(ROUNDS):
        made = [rows_at(scene, f, object_pose, noise_per_z2, point) for f in frames]
        joint = {c: joined([m[c] for m in made]) for c in CHANNELS}
        rows = {c: r for c, r in joint.items() if len(r.value)}
        found = most_probable(rows, stated, together)
        before = point
        point = _without_small_lens(scene, {n: value for n, value in found.items() if n in FLOWS})
        zero = {n: np.zeros(len(v)) for n, v in (*before.items(), *point.items())}
        step = {n: point.get(n, z) - before.get(n, z) for n, z in zero.items()}
        moved = [np.sqrt(np.mean(_moved_by(rows[c], step) ** 2)) / s for c, s in SMALL.items() if c in rows]
        if max(moved, default=0.0) < 1.0:
            break
    return point


def most_probable(
    rows: Mapping[str, Rows], stated: ImageTolerances, together: Sequence[str] = ()
) -> dict[str, np.ndarray]:
    """Amplitudes by name: all within what is stated, but for the one error that explains most beyond it.

    One error beyond tolerance, the one of most evidence (Gaussian priors, in closed form): were all wide, a
    large error would be spread over all that look like it, and the scene rendered where none of them is.
    Names that are `together` are all wide, and no other is: a fit that does not ask which of them it is.
    """
    sigma = noise_of_rows(rows, {})[1]
    spreads = stated_spreads(stated)
    spreads |= {name: np.maximum(WIDE[name], spreads[name]) for name in together}
    starts, start = {}, 0
    for name, widths in spreads.items():
        starts[name], start = start, start + len(widths)
    normal, moment = np.zeros((start, start)), np.zeros(start)
    for channel, r in rows.items():
        design = np.zeros((start, len(r.value)))
        for name, columns in r.columns.items():
            design[starts[name] : starts[name] + len(columns)] = columns / sigma[channel]
        normal += design @ design.T
        moment += design @ (r.value / sigma[channel])
    stated_widths = np.concatenate(list(spreads.values()))
    best, most = np.zeros(start), -np.inf
    for group in (), *(() if together else _alone(spreads)):
        widths = stated_widths.copy()
        for name, k in group:
            widths[starts[name] + k] = max(WIDE[name], widths[starts[name] + k])
        scaled = widths[:, None] * normal * widths + np.eye(start)
        factor = linalg.cho_factor(scaled)
        found = linalg.cho_solve(factor, widths * moment)
        evidence = 0.5 * float(found @ (widths * moment)) - float(np.sum(np.log(np.diag(factor[0]))))
        if evidence > most:
            best, most = widths * found, evidence
        if not group:  # what follows must be worth more than chance makes of one in thirty
            most += BEYOND
    return {name: best[starts[name] : starts[name] + len(w)] for name, w in spreads.items()}


def _alone(spreads: Mapping[str, np.ndarray]) -> list[list[tuple[str, int]]]:
    """Columns (name, index) of each error that may be beyond tolerance alone."""
    joints = [[(name, k)] for name in ("camera_zeros", "tool_zeros") for k in range(len(spreads[name]))]
    whole = [("hand_eye",), ("base",), ("camera_late", "tool_late"), ("tool_late",), ("held",),
             ("object_scale",), ("focal",), ("centre",), ("focal", "centre"), ("radial",),
             ("radial", "tangential"), ("depth_scale", "depth_offset"), ("depth_shift",),
             ("outline_object", "outline_tip")]  # fmt: skip
    return [*([(n, k) for n in names for k in range(len(spreads[n]))] for names in whole), *joints]


def _moved_by(rows: Rows, point: Point) -> np.ndarray:
    out = np.zeros(len(rows.value))
    for name, amplitudes in point.items():
        if name in rows.columns:
            out = out + amplitudes @ rows.columns[name]
    return out


FLOWS = (*OF_CAMERA, "tool_zeros", "tool_late", "held", "object", "object_scale", *OF_LENS)
