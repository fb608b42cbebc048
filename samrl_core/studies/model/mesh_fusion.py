"""How good is a mesh fused from RGB-D photos, and what does eq. 7 make of it?

A body of each task is photographed from known poses with the cell's noise, fused, and updated by eq. 7. A
second update starts from the fused mesh swollen by 3 mm, as a CAD model of the wrong size would be. Truth
(the CAD surface at its pose, photos without noise) is read here alone, after the meshes are made.

Distances: from samples of the whole mesh to the CAD surface, undersides that close it included; and from
samples of that part of the CAD surface that some view shows to the mesh. The chamfer distance is their mean.
Colours: on photos without noise from four poses that the mesh was not made from, mean absolute difference of
mask times colour per pixel of the mask (eq. 4), and of colours alone where both show the body.

    python -m samrl_core.studies.model.mesh_fusion --out DIR
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import torch

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.camera import Camera, Intrinsics
from samrl_core.cell.types.pose import look_at
from samrl_core.cell.types.scene import Body
from samrl_core.cell.world.pybullet.body_photos import BodyPhotos
from samrl_core.common.errors import InputError
from samrl_core.common.files import write_whole
from samrl_core.model.fusion.chamfer import Chamfer, Surface, chamfer, surface_samples
from samrl_core.model.fusion.fuse import FusedMesh, FusionSettings, fuse
from samrl_core.model.fusion.masked_view import MaskedView
from samrl_core.model.fusion.refine import MeshRenderer, RefineSettings, refine
from samrl_core.studies.model.fusion_picture import PictureRow, save_picture

TARGET_M = 0.003  # chamfer distance
BODIES = {"pancake": "spatula_flipping", "needle": "needle_threading", "hole_board": "peg_insertion"}
SWELLING = 0.003  # of the rough start [m]
DISTANCE = 0.38  # of the cameras from the middle of the body [m]
HELD_OUT = 4  # photos for the evaluation
SAMPLES = 6000  # of each surface
_NEAR_SURFACE = 0.004  # a sample whose depth differs less from the photo's is shown by it [m]


@dataclass(frozen=True)
class MeshScore:
    """What a mesh is worth."""

    chamfer: float  # mean of both directions [m]
    mesh_to_cad: float  # [m]
    cad_to_mesh: float  # [m]
    mesh_to_cad_95: float  # 95 % of the samples are nearer [m]
    cad_to_mesh_95: float  # [m]
    seen_to_cad: float  # from the observed part of the mesh [m]
    image_error: float  # eq. 4 on held-out photos, 0..1
    color_error: float  # where photo and mesh both show the body, 0..1
    overlap: float  # of the masks, intersection over union


@dataclass(frozen=True)
class Result:
    """One body, one seed."""

    body: str
    seed: int
    faces: int
    seen_share: float  # of the mesh's vertices
    shown_share: float  # of the CAD surface
    stages: dict[str, MeshScore]
    why_stopped: dict[str, str]
    process_s: dict[str, float]  # CPU time


def cameras(middle: np.ndarray, count: int, intrinsics: Intrinsics) -> list[Camera]:
    """Around a point (3,), at 25 and 55 degrees above the horizon in turn."""
    return [_camera(middle, 2 * math.pi * k / count, (25.0, 55.0)[k % 2], intrinsics) for k in range(count)]


def _camera(middle: np.ndarray, turn: float, rise_deg: float, intrinsics: Intrinsics) -> Camera:
    rise = math.radians(rise_deg)
    way = np.array([math.cos(turn) * math.cos(rise), math.sin(turn) * math.cos(rise), math.sin(rise)])
    return Camera(intrinsics, look_at(middle + DISTANCE * way, middle))


class MeshEvaluator:
    """The truth about one body, and the mesh's distance to it."""

    def __init__(self, body: Body, photos: BodyPhotos, views: list[Camera], intrinsics: Intrinsics) -> None:
        """Perfect photos from the views, to know what they show, and from elsewhere, to evaluate colours."""
        vertices = body.body_in_world.apply(body.mesh.vertices)
        self.middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
        elsewhere = [
            _camera(self.middle, 2 * math.pi * (k + 0.5) / HELD_OUT, 40.0, intrinsics)
            for k in range(HELD_OUT)
        ]
        self.held_out = [_perfect(photos, camera, body.label) for camera in elsewhere]
        samples, _ = surface_samples(vertices, body.mesh.faces, SAMPLES, np.random.default_rng(0))
        shown: np.ndarray = np.zeros(len(samples), dtype=bool)
        for view in (_perfect(photos, camera, body.label) for camera in views):
            u, v, z = view.camera.project(samples).T
            framed = view.camera.intrinsics.frames(u, v, z)
            row, column = np.where(framed, v, 0).astype(int), np.where(framed, u, 0).astype(int)
            shown = shown | (framed & (np.abs(view.depth[row, column] - z) < _NEAR_SURFACE))
        self.shown_share = float(shown.mean())
        self._cad = (samples[shown], Surface(vertices, body.mesh.faces))

    def images(self, mesh: FusedMesh) -> tuple[np.ndarray, np.ndarray]:
        """Coverage times colour (B, H, W, 3), and coverage (B, H, W), from the held-out poses."""
        with torch.no_grad():
            image = MeshRenderer(mesh, self.held_out)(
                torch.from_numpy(mesh.vertices), torch.from_numpy(mesh.color)
            )
        return image.color.numpy(), image.target.numpy()

    def stage(self, mesh: FusedMesh) -> MeshScore:
        """All metrics of a mesh."""
        samples, face = surface_samples(mesh.vertices, mesh.faces, SAMPLES, np.random.default_rng(1))
        apart: Chamfer = chamfer((samples, Surface(mesh.vertices, mesh.faces)), self._cad)
        observed = np.all(mesh.observed[mesh.faces[face]], axis=1)
        color, coverage = self.images(mesh)
        image_error, color_error, overlap = [], [], []
        for view, rendered, share in zip(self.held_out, color, coverage, strict=True):
            cut = np.abs(rendered - view.color * view.mask[..., None]).mean(axis=-1)
            image_error.append(cut.sum() / view.mask.sum())
            apart_there = np.abs(rendered - view.color).mean(axis=-1)
            color_error.append(float(np.mean(apart_there, where=view.mask & (share > 0.99))))
            overlap.append((view.mask & (share > 0.5)).sum() / (view.mask | (share > 0.5)).sum())
        return MeshScore(
            apart.mean,
            apart.forward,
            apart.backward,
            apart.largest_forward,
            apart.largest_backward,
            float(self._cad[1].distance(samples[observed]).mean()),
            float(np.mean(image_error)),
            float(np.mean(color_error)),
            float(np.mean(overlap)),
        )


def _perfect(photos: BodyPhotos, camera: Camera, label: int) -> MaskedView:
    picture = photos.perfect(camera)
    return MaskedView(picture.color / 255.0, picture.depth, picture.mask == label, camera)


def swollen(mesh: FusedMesh, by: float) -> FusedMesh:
    """The mesh with every vertex moved outwards along its normal [m]."""
    corners = mesh.vertices[mesh.faces]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal = np.zeros_like(mesh.vertices)
    for k in range(3):
        np.add.at(normal, mesh.faces[:, k], area)
    return replace(mesh, vertices=mesh.vertices + by * normal / np.linalg.norm(normal, axis=1, keepdims=True))


def run(
    name: str, seed: int, count: int, fusion: FusionSettings, settings: RefineSettings
) -> tuple[Result, PictureRow]:
    """Photographs, fuses, updates and evaluates one body."""
    cell = cell_named()
    body = next(b for b in task_named(BODIES[name]).scene(cell).bodies if b.name == name)
    photos = BodyPhotos(body)
    vertices = body.body_in_world.apply(body.mesh.vertices)
    around = cameras(0.5 * (vertices.min(axis=0) + vertices.max(axis=0)), count, cell.intrinsics)
    rng = np.random.default_rng(seed)
    views = [MaskedView.of(photos.read(camera, rng), camera, body.label) for camera in around]
    spent, why = {}, {}
    began = time.process_time()
    fused = fuse(views, fusion)
    spent["fused"] = time.process_time() - began
    meshes = {"fused": fused, "rough": swollen(fused, SWELLING)}
    far = replace(settings, vertex_std=SWELLING)
    for start, chosen in (("fused", settings), ("rough", far)):
        began = time.process_time()
        updated = refine(meshes[start], views, chosen, partial(_describe, name, start))
        spent[f"{start}_updated"] = time.process_time() - began
        why[f"{start}_updated"] = updated.why_stopped
        meshes[f"{start}_updated"] = updated.mesh
    evaluator = MeshEvaluator(body, photos, around, cell.intrinsics)
    photos.close()
    stages = {stage: evaluator.stage(mesh) for stage, mesh in meshes.items()}
    result = Result(
        name, seed, len(fused.faces), float(fused.observed.mean()), evaluator.shown_share, stages, why, spent
    )
    shown = {stage: evaluator.images(mesh)[0][0] for stage, mesh in meshes.items()}
    return result, PictureRow(name, evaluator.held_out[0], shown)


def _describe(name: str, start: str, iteration: int, loss: float) -> None:
    if iteration % 10 == 0:
        print(f"  {name}, update of the {start} mesh, iteration {iteration}: loss {loss:.4f}", flush=True)


def main(arguments: list[str] | None = None) -> int:
    """Run the study from the command line; 1 where a fused mesh is beyond the target."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--bodies", nargs="+", choices=sorted(BODIES), default=sorted(BODIES))
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--views", type=int, default=12)
    parser.add_argument("--voxel", type=float, default=FusionSettings().voxel_size, help="[m]")
    parser.add_argument("--iterations", type=int, default=RefineSettings().iterations)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args(arguments)
    if options.seeds < 1 or options.views < 1:
        raise InputError(f"--seeds {options.seeds} and --views {options.views} must be at least 1")
    fusion = FusionSettings(voxel_size=options.voxel)
    settings = RefineSettings(iterations=options.iterations)
    return run_study(options.out, options.bodies, range(options.seeds), options.views, fusion, settings)


def run_study(
    out: Path,
    bodies: Sequence[str],
    seeds: Sequence[int],
    views: int,
    fusion: FusionSettings,
    settings: RefineSettings,
) -> int:
    """Run, print a table, write mesh_fusion.json and mesh_fusion.png; 1 where a mesh is beyond the target.

    Args:
        out: folder.
        bodies: of `BODIES`.
        seeds: of the photos' noise.
        views: photos of each body.
        fusion: resolution.
        settings: of the update.
    """
    out.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)  # images are too small to share
    results, rows = [], []
    print(f"{'body':11} seed {'mesh':14} {'chamfer':>8} {'to CAD':>7} {'from':>6} mm  image  color  overlap")
    for name in bodies:
        for seed in seeds:
            result, row = run(name, seed, views, fusion, settings)
            results.append(result)
            rows += [row] if seed == seeds[0] else []
            for stage, s in result.stages.items():
                print(
                    f"{name:11} {seed:4} {stage:14} {1e3 * s.chamfer:8.3f} {1e3 * s.mesh_to_cad:7.3f} "
                    f"{1e3 * s.cad_to_mesh:6.3f}     {s.image_error:.4f} {s.color_error:.4f} {s.overlap:.3f}",
                    flush=True,
                )
    worst = max(r.stages["fused"].chamfer for r in results)
    print(f"worst chamfer distance of a fused mesh {1e3 * worst:.3f} mm, target {1e3 * TARGET_M:g} mm")
    record = {
        "schema": 1,
        "views": views,
        "target_m": TARGET_M,
        "swelling_m": SWELLING,
        "fusion": asdict(fusion),
        "refine": asdict(settings),
        "results": [asdict(r) for r in results],
    }
    write_whole(out / "mesh_fusion.json", json.dumps(record, indent=1))
    save_picture(rows, out / "mesh_fusion.png")
    return 0 if worst <= TARGET_M else 1


if __name__ == "__main__":
    raise SystemExit(main())
