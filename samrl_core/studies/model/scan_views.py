"""A mesh from a file of RGB-D views with masks and camera poses: PLY, a JSON about it, and a picture."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
import trimesh
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from samrl_core.cell.types.camera import Camera, Intrinsics
from samrl_core.cell.types.pose import Pose
from samrl_core.common.array_file import MAX_BYTES, unpacked, write_arrays
from samrl_core.common.errors import InputError
from samrl_core.common.files import read_whole, write_whole
from samrl_core.model.fusion.fuse import FusedMesh, FusionSettings, fuse
from samrl_core.model.fusion.masked_view import MaskedView
from samrl_core.model.fusion.refine import MeshRenderer, RefineSettings, refine

NAME = "scan"
SHOWN = 4  # views in the picture, at most
# Of a file of N views.
ARRAYS = {
    "color": "(N, H, W, 3) uint8, linear RGB",
    "depth": "(N, H, W) float along the optical axis [m], NaN where unmeasured",
    "mask": "(N, H, W) bool, where the body is visible",
    "intrinsics": "(4,) fx, fy, cx, cy [px], counted from the outer corner of the first pixel",
    "camera_in_world": "(N, 4, 4) pose of each optical frame",
}


def write_views(path: Path, views: Sequence[MaskedView]) -> None:
    """Write views of one lens as NPZ, see `ARRAYS`."""
    k = views[0].camera.intrinsics
    write_arrays(
        path,
        {
            "color": np.stack([np.round(255.0 * v.color).astype(np.uint8) for v in views]),
            "depth": np.stack([v.depth for v in views]),
            "mask": np.stack([v.mask for v in views]),
            "intrinsics": np.array([k.fx, k.fy, k.cx, k.cy]),
            "camera_in_world": np.stack([v.camera.camera_in_world.matrix() for v in views]),
        },
    )


def read_views(path: Path) -> list[MaskedView]:
    """Read a file that `write_views` or `numpy.savez` wrote.

    Raises:
        InputError: the file cannot be read, an array is missing or has another shape, or a view is refused.
    """
    arrays = unpacked(read_whole(path, MAX_BYTES), path, "give an .npz file of views")
    if set(arrays) != set(ARRAYS):
        wanted = "; ".join(f"{name} {text}" for name, text in ARRAYS.items())
        raise InputError(f"{path} holds the arrays {', '.join(sorted(arrays)) or 'none'}, must hold {wanted}")
    color, depth, mask, k, poses = (arrays[name] for name in ARRAYS)
    shape = depth.shape
    wanted_shapes = ((*shape, 3), shape, shape, (4,), (*shape[:1], 4, 4))
    if len(shape) != 3 or tuple(a.shape for a in (color, depth, mask, k, poses)) != wanted_shapes:
        wrong = "; ".join(f"{name} has {arrays[name].shape}, must be {ARRAYS[name]}" for name in ARRAYS)
        raise InputError(f"{path}: shapes do not fit: {wrong}")
    if color.dtype != np.uint8 or mask.dtype != np.bool_:
        raise InputError(f"{path}: color is {color.dtype}, must be uint8; mask is {mask.dtype}, must be bool")
    views = []
    for number in range(len(depth)):
        try:
            intrinsics = Intrinsics(shape[2], shape[1], *(float(x) for x in k))
            camera = Camera(intrinsics, Pose.from_matrix(poses[number]))
            view = MaskedView(color[number] / 255.0, depth[number].astype(float), mask[number], camera)
        except InputError as error:
            raise InputError(f"{path}, view {number}: {error}") from error
        views.append(view)
    return views


def scan_views(path: Path, out: Path, fusion: FusionSettings, iterations: int) -> FusedMesh:
    """Fuse the views of a file; write scan.ply, scan.json and scan.png into `out`.

    Args:
        path: of the views, see `ARRAYS`.
        out: folder.
        fusion: resolution and floor.
        iterations: of the update by the images (eq. 7); 0 for none.

    Raises:
        InputError: the file is refused, or its views give no surface.
    """
    views = read_views(path)
    mesh = fuse(views, fusion)
    updated = refine(mesh, views, RefineSettings(iterations=iterations)) if iterations else None
    mesh = mesh if updated is None else updated.mesh
    colors = np.clip(np.round(255.0 * mesh.color), 0, 255).astype(np.uint8)
    surface = trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_colors=colors, process=False)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    record = {
        "schema": 1,
        "views": len(views),
        "voxel_size_m": fusion.voxel_size,
        "truncation_m": fusion.truncation,
        "iterations": iterations,
        "why_stopped": "not_updated" if updated is None else updated.why_stopped,
        "vertices": len(mesh.vertices),
        "faces": len(mesh.faces),
        "dropped_faces": mesh.dropped_faces,  # of specks beside the largest surface
        "watertight": bool(surface.is_watertight),
        "volume_m3": float(surface.volume),
        "seen_share": float(mesh.observed.mean()),
        "size_m": (high - low).tolist(),
        "center_in_world_m": (0.5 * (low + high)).tolist(),
    }
    write_whole(out / f"{NAME}.ply", surface.export(file_type="ply"))  # ty: ignore[invalid-argument-type]
    write_whole(out / f"{NAME}.json", json.dumps(record, indent=1) + "\n")
    _write_picture(mesh, views, out / f"{NAME}.png")
    return mesh


def _write_picture(mesh: FusedMesh, views: Sequence[MaskedView], path: Path) -> None:
    """A column per view: the photo, cut out, and below it the mesh from the same pose."""
    shown = [views[k] for k in np.unique(np.linspace(0, len(views) - 1, SHOWN).astype(int))]
    with torch.no_grad():
        image = MeshRenderer(mesh, shown)(torch.from_numpy(mesh.vertices), torch.from_numpy(mesh.color))
    figure = Figure(figsize=(2.5 * len(shown), 5), layout="constrained")
    axes = figure.subplots(2, len(shown), squeeze=False)
    for column, view in enumerate(shown):
        axes[0, column].imshow(np.where(view.mask[..., None], view.color, 0.0))
        axes[1, column].imshow(np.clip(image.color[column].numpy(), 0.0, 1.0))
    axes[0, 0].set_title("photo", fontsize=9)
    axes[1, 0].set_title("mesh", fontsize=9)
    for axis in axes.ravel():
        axis.set_axis_off()
    FigureCanvasAgg(figure).print_png(str(path))
