"""What the renderer's kernels need of a scene and a lens, copied to a device once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import warp as wp

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.common.devices import numbered_device
from samrl_core.common.warp_runtime import start
from samrl_core.model.rendering import cut_kernels, edge_kernels, light_kernels, raster_kernels, shade_kernels
from samrl_core.model.rendering.kernel_types import EdgeUse, Pixel
from samrl_core.model.rendering.topology import Topology

_MODULES = (raster_kernels, shade_kernels, edge_kernels, cut_kernels, light_kernels)


@dataclass(frozen=True, eq=False)
class RasterSetup:
    """What stays the same between images: connectivity and lens, on one device."""

    device: str
    faces: Any  # wp.array (F, 3) int32
    face_label: Any  # wp.array (F,) int32
    face_part: Any  # wp.array (F,) int32
    edge_start: Any  # wp.array (E + 1,) int32
    edge_uses: Any  # wp.array (U,) of 4 int32
    neighbors: Any  # wp.array (F, 3) int32
    corner_normal: Any  # wp.array (F, 3) int32
    normal_start: Any  # wp.array (N + 1,) int32
    normal_faces: Any  # wp.array (3F,) int32
    lens: Any  # raster_kernels.Pinhole
    width: int  # [px]
    height: int  # [px]
    samples: int  # per pixel and direction
    edge_step: float  # [px]
    background: Any  # Pixel
    threads: int  # at most so many on a CPU, each with images of its own
    on_gpu: bool

    def seen_through(self, intrinsics: Intrinsics) -> RasterSetup:
        """The same scene through another lens."""
        k = intrinsics
        return replace(self, lens=_lens(k, self.lens.near), width=k.width, height=k.height)


def make_setup(
    topology: Topology,
    intrinsics: Intrinsics,
    near: float,
    samples: int,
    edge_step: float,
    background: tuple[float, float, float],
    device: str,
    threads: int,
) -> RasterSetup:
    """Copies connectivity to the device.

    Args:
        topology: triangles and edges.
        intrinsics: lens and image size.
        near: nothing nearer than this is rendered [m].
        samples: per pixel and direction.
        edge_step: longest step of the edge integral [px].
        background: linear RGB where nothing is rendered.
        device: torch and Warp name of the device.
        threads: at most so many work on one batch, on a CPU.
    """
    start()
    where = numbered_device(device)
    name = str(wp.device_from_torch(where))

    def copied(array: Any, dtype: Any = wp.int32) -> Any:
        return wp.array(array, dtype=dtype, device=name)

    for module in _MODULES:  # before threads meet in the loader
        wp.load_module(module, device=name)
    return RasterSetup(
        device=name,
        faces=copied(topology.faces),
        face_label=copied(topology.face_label),
        face_part=copied(topology.face_part),
        edge_start=copied(topology.edge_start),
        edge_uses=copied(topology.edge_uses, EdgeUse),
        neighbors=copied(topology.neighbors),
        corner_normal=copied(topology.corner_normal),
        normal_start=copied(topology.normal_start),
        normal_faces=copied(topology.normal_faces),
        lens=_lens(intrinsics, near),
        width=intrinsics.width,
        height=intrinsics.height,
        samples=samples,
        edge_step=edge_step,
        background=Pixel(*background, 0.0, 0.0, 0.0, 0.0),
        threads=threads if where.type == "cpu" else 1,
        on_gpu=where.type != "cpu",
    )


def _lens(intrinsics: Intrinsics, near: float) -> Any:
    lens, k = raster_kernels.Pinhole(), intrinsics
    lens.fx, lens.fy, lens.cx, lens.cy, lens.near = k.fx, k.fy, k.cx, k.cy, near
    return lens
