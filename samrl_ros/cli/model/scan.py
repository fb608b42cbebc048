"""`samrl scan`: a closed, coloured mesh from RGB-D views with masks and camera poses."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from samrl_core.common.errors import InputError
from samrl_core.model.fusion.fuse import FusionSettings
from samrl_core.model.fusion.refine import RefineSettings
from samrl_core.studies.model.scan_views import ARRAYS, NAME, scan_views


@dataclass(frozen=True)
class ScanOptions:
    """Options of `samrl scan`."""

    views: Annotated[
        Path | None,
        typer.Argument(
            help="NPZ file of views, with the arrays "
            + ", ".join(ARRAYS)
            + "; without it, bodies of the tasks are photographed in PyBullet."
        ),
    ] = None
    out: Annotated[Path, typer.Option(help="Folder of mesh, JSON and picture.")] = Path("out/scan")
    voxel: Annotated[float, typer.Option(help="Edge of a voxel in metres.")] = FusionSettings.voxel_size
    floor: Annotated[
        float, typer.Option(help="Height of the table's top in metres, in world; nan where there is none.")
    ] = FusionSettings.floor_height
    iterations: Annotated[
        int, typer.Option(help="Of the update by the images (eq. 7); 0 for none.", min=0)
    ] = RefineSettings.iterations
    bodies: Annotated[
        tuple[str, ...],
        typer.Option("--body", help="Simulated body, without a file; repeat for more, all unless given."),
    ] = ()
    photos: Annotated[int, typer.Option(help="Simulated photos of each body, without a file.", min=1)] = 12
    seed: Annotated[int, typer.Option(help="Of the simulated photos; fusion of a file has none.", min=0)] = 0


def scan(options: ScanOptions) -> int:
    """Fuse the file's views, or run the study on simulated ones.

    Raises:
        InputError: the file or its views are refused, no such body, or the folder cannot be written.
    """
    o, console = options, Console()
    floor = -math.inf if math.isnan(o.floor) else o.floor
    fusion = FusionSettings(voxel_size=o.voxel, floor_height=floor)
    try:
        if o.views is None:
            return _scan_simulated(o, fusion)
        mesh = scan_views(o.views, o.out, fusion, o.iterations)
    except OSError as error:
        raise InputError(f"cannot write to {o.out} ({error}); give another --out") from error
    size = 1e3 * (mesh.vertices.max(axis=0) - mesh.vertices.min(axis=0))
    console.print(
        f"{len(mesh.faces)} faces, {size[0]:.1f} x {size[1]:.1f} x {size[2]:.1f} mm, "
        f"{100 * mesh.observed.mean():.0f} % of the vertices were observed",
        highlight=False,
    )
    for kind in ("ply", "json", "png"):
        console.print(o.out / f"{NAME}.{kind}", highlight=False, soft_wrap=True)
    return 0


def _scan_simulated(o: ScanOptions, fusion: FusionSettings) -> int:
    from samrl_core.studies.model.mesh_fusion import BODIES, run_study  # needs PyBullet

    unknown = sorted(set(o.bodies) - set(BODIES))
    if unknown:
        raise InputError(f"no body {unknown[0]!r}; there are {', '.join(sorted(BODIES))}")
    settings = RefineSettings(iterations=o.iterations)
    return run_study(o.out, o.bodies or sorted(BODIES), [o.seed], o.photos, fusion, settings)
