"""The only bridge between Warp and torch: one differentiable function from camera points to an image."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from types import SimpleNamespace
from typing import Any

import torch
import warp as wp

from samrl_core.model import cut_kernels, edge_kernels, light_kernels, raster_kernels, shade_kernels
from samrl_core.model.kernel_types import CHANNELS, EdgeUse, LightRow, Pixel
from samrl_core.model.threads import in_threads, shares
from samrl_core.model.topology import Topology
from samrl_core.warp_runtime import start

_MODULES = (raster_kernels, shade_kernels, edge_kernels, cut_kernels, light_kernels)
_GATHERED = 16  # pixels of a row that one GPU thread sums up before it adds to a triangle
_STRIPS = 32  # GPU threads that share a triangle of a single image: a table fills half of one


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
    lens: Any  # raster_kernels.Lens
    width: int  # [px]
    height: int  # [px]
    samples: int  # per pixel and direction
    edge_step: float  # [px]
    background: Any  # Pixel
    threads: int  # at most so many on a CPU, each with images of its own
    on_gpu: bool


def make_setup(
    topology: Topology,
    lens: tuple[float, float, float, float, float],
    size: tuple[int, int],
    samples: int,
    edge_step: float,
    background: tuple[float, float, float],
    device: str,
    threads: int,
) -> RasterSetup:
    """Copies connectivity to the device.

    Args:
        topology: triangles and edges.
        lens: fx, fy, cx, cy [px], near [m].
        size: width, height [px].
        samples: per pixel and direction.
        edge_step: longest step of the edge integral [px].
        background: linear RGB where nothing is drawn.
        device: torch and Warp name of the device.
        threads: at most so many work on one batch, on a CPU.
    """
    start()
    where = torch.device(device)
    name = str(wp.device_from_torch(where))
    lens_struct = raster_kernels.Lens()
    lens_struct.fx, lens_struct.fy, lens_struct.cx, lens_struct.cy, lens_struct.near = lens

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
        lens=lens_struct,
        width=size[0],
        height=size[1],
        samples=samples,
        edge_step=edge_step,
        background=Pixel(*background, 0.0, 0.0, 0.0, 0.0),
        threads=threads if where.type == "cpu" else 1,
        on_gpu=where.type != "cpu",
    )


def _launch_rows(
    setup: RasterSetup, kernel: Any, size: tuple[int, int, int], gathered: int, inputs: list[Any]
) -> None:
    """Launches a kernel that takes rows in runs: on a CPU whole ones, for neighbours mostly see one triangle.

    `size` is batch, height and width of what it goes over, `gathered` the run of a GPU's thread, which comes
    first among the inputs.
    """
    batch, height, width = size
    run = gathered if setup.on_gpu else width
    _launch(setup, kernel, (batch, height, -(-width // run)), [run, *inputs])


def _strips(setup: RasterSetup, batch: int) -> int:
    """Threads per triangle: with many images there is work enough for all."""
    return max(1, min(_STRIPS, 4096 // batch)) if setup.on_gpu else 1


_TYPES: dict[str, Any] = {
    "points": wp.vec3,
    "attributes": Pixel,
    "light": LightRow,
    "planes": wp.mat33,
    "boxes": wp.vec4,
    "keys": wp.int64,
    "areas": wp.vec3,
    "normals": wp.vec3,
    "brightness": wp.vec3,
    "image": Pixel,
    "depth": wp.float32,
    "label": wp.int32,
    "claims": wp.uint8,
    "corners": Pixel,
}


@cache
def _empty(batch: int, dtype: Any, device: str) -> Any:
    """Nothing is lit: kernels see it by the length of the second axis."""
    return wp.zeros((batch, 0), dtype=dtype, device=device)


def _views(tensors: dict[str, torch.Tensor], images: slice) -> SimpleNamespace:
    """Warp's view of some of the images in every tensor; `x_grad` has the type of `x`.

    Descriptors instead of Warp's arrays halve what a small image costs.
    """
    views = {}
    for name, tensor in tensors.items():
        dtype = LightRow if name == "light_shares" else _TYPES[name.removesuffix("_grad")]
        part = tensor[images]
        if part.numel() == 0:
            views[name] = _empty(part.shape[0], dtype, str(part.device))
        else:
            views[name] = wp.from_torch(part, dtype=dtype, requires_grad=False, return_ctype=True)
    return SimpleNamespace(**views, batch=images.stop - images.start)


def _launch(setup: RasterSetup, kernel: Any, dim: tuple[int, ...], inputs: list[Any]) -> None:
    wp.launch(kernel, dim=dim, inputs=inputs, device=setup.device, record_tape=False)


def _draw(setup: RasterSetup, tensors: dict[str, torch.Tensor], lit: bool, images: slice) -> None:
    """Forward pass of some images."""
    t = _views(tensors, images)
    batch, n_faces = t.batch, setup.faces.shape[0]
    faces = (batch, n_faces)
    if lit:
        normals = (batch, setup.normal_start.shape[0] - 1)
        _launch(setup, light_kernels.face_areas, faces, [t.attributes, setup.faces, t.areas])
        inputs = [t.areas, setup.normal_start, setup.normal_faces, t.normals]
        _launch(setup, light_kernels.average_normals, normals, inputs)
        inputs = [t.points, setup.faces, setup.corner_normal, t.normals, t.light, t.brightness]
        _launch(setup, light_kernels.brighten, faces, inputs)
    inputs = [t.points, setup.faces, setup.lens, setup.width, setup.height, t.planes, t.boxes]
    _launch(setup, raster_kernels.set_up_triangles, faces, inputs)
    strips = _strips(setup, batch)
    inputs = [t.planes, t.boxes, setup.lens.near, setup.samples, strips, t.keys]
    _launch(setup, raster_kernels.rasterize, (*faces, strips), inputs)
    inputs = [
        t.planes,
        setup.faces,
        t.attributes,
        t.brightness,
        setup.face_label,
        setup.background,
        setup.samples,
        t.keys,
        t.image,
        t.depth,
        t.label,
    ]
    _launch_rows(setup, shade_kernels.shade, (batch, setup.height, setup.width), 1, inputs)


def _differentiate(setup: RasterSetup, tensors: dict[str, torch.Tensor], lit: bool, images: slice) -> None:
    """Backward pass of some images: shading at the visible samples, then everything that jumps."""
    t = _views(tensors, images)
    batch, n_faces = t.batch, setup.faces.shape[0]
    shading = [t.planes, setup.faces, t.attributes, t.brightness]
    pixels = (batch, setup.height, setup.width)
    inputs = [*shading, setup.samples, t.keys, t.image_grad, t.planes_grad, t.corners_grad]
    _launch_rows(setup, shade_kernels.shade_adjoint, pixels, _GATHERED, inputs)
    inputs = [
        t.points,
        t.planes,
        setup.faces,
        setup.face_part,
        setup.neighbors,
        t.attributes,
        t.brightness,
        setup.edge_start,
        setup.edge_uses,
        setup.background,
        setup.lens,
        setup.samples,
        setup.edge_step,
        t.keys,
        t.image_grad,
        t.points_grad,
        t.claims,
    ]
    _launch(setup, edge_kernels.integrate_edges, (batch, setup.edge_start.shape[0] - 1), inputs)
    inputs = [
        t.planes,
        setup.faces,
        setup.face_part,
        setup.neighbors,
        t.attributes,
        t.brightness,
        setup.background,
        setup.lens.near,
        setup.samples,
        t.keys,
        t.claims,
        t.image_grad,
        t.planes_grad,
    ]
    height, width = tensors["keys"].shape[1:]
    _launch_rows(setup, cut_kernels.integrate_cuts, (batch, height, width), 1, inputs)
    inputs = [
        t.points,
        setup.faces,
        t.attributes,
        t.brightness,
        setup.lens,
        t.planes_grad,
        t.corners_grad,
        t.points_grad,
        t.attributes_grad,
        t.brightness_grad,
    ]
    faces = (batch, n_faces)
    _launch(setup, shade_kernels.triangles_adjoint, faces, inputs)
    if lit:
        shared = [setup.faces, setup.corner_normal]
        inputs = [t.points, *shared, t.normals, t.light, t.brightness_grad, t.normals_grad, t.light_shares]
        _launch(setup, light_kernels.brighten_adjoint, faces, inputs)
        inputs = [t.attributes, *shared, t.normals_grad, t.attributes_grad]
        _launch(setup, light_kernels.face_areas_adjoint, faces, inputs)


class Rasterize(torch.autograd.Function):
    """Image, depth and label from points in camera coordinates and values per vertex.

    `Rasterize.apply(points (B, V, 3) [m], attributes (B, V, 7), light (B, 5), setup)` returns image
    (B, H, W, 7), depth (B, H, W) [m] and label (B, H, W) int32; a light (B, 0) leaves colours as they
    are. Gradients flow through the image to the three tensors. Threads share the batch, each image stays
    in one thread, so that the result does not depend on their number.
    """

    @staticmethod
    def forward(
        ctx: Any, points: torch.Tensor, attributes: torch.Tensor, light: torch.Tensor, setup: RasterSetup
    ) -> Any:
        """Rasterise and shade; keeps the z-buffer for the backward pass."""
        batch, s = points.shape[0], setup.samples
        lit = light.shape[1] > 0
        n_faces = setup.faces.shape[0] if lit else 0
        n_normals = setup.normal_start.shape[0] - 1 if lit else 0
        float32 = {"dtype": torch.float32, "device": points.device}
        size = (batch, setup.height, setup.width)
        keys = torch.zeros(
            (batch, setup.height * s, setup.width * s), dtype=torch.int64, device=points.device
        )
        kept = {
            "points": points.detach().contiguous(),
            "attributes": attributes.detach().contiguous(),
            "light": light.detach().contiguous(),
            "planes": torch.zeros((batch, setup.faces.shape[0], 3, 3), **float32),
            "keys": keys,
            "normals": torch.empty((batch, n_normals, 3), **float32),
            "brightness": torch.empty((batch, n_faces, 3), **float32),
        }
        made = {
            "image": torch.empty((*size, CHANNELS), **float32),
            "depth": torch.empty(size, **float32),
            "label": torch.empty(size, dtype=torch.int32, device=points.device),
            "boxes": torch.empty((batch, setup.faces.shape[0], 4), **float32),
            "areas": torch.empty((batch, n_faces, 3), **float32),
        }
        tensors = kept | made
        in_threads(lambda part: _draw(setup, tensors, lit, part), shares(batch, setup.threads))
        ctx.save_for_backward(*kept.values())
        ctx.names = tuple(kept)
        ctx.setup = setup
        ctx.mark_non_differentiable(made["depth"], made["label"])
        return made["image"], made["depth"], made["label"]

    @staticmethod
    def backward(ctx: Any, *grads: torch.Tensor | None) -> Any:
        """Adjoint of shading at the visible samples, then the integrals over all jumps."""
        tensors = dict(zip(ctx.names, ctx.saved_tensors, strict=True))
        setup: RasterSetup = ctx.setup
        if grads[0] is None:
            return None, None, None, None
        lit = tensors["light"].shape[1] > 0
        for name in ("points", "attributes", "planes", "normals", "brightness"):
            tensors[name + "_grad"] = torch.zeros_like(tensors[name])
        planes = tensors["planes"]
        batch, n_faces = planes.shape[:2]
        tensors["image_grad"] = grads[0].contiguous()
        tensors["corners_grad"] = planes.new_zeros((batch, n_faces, 3, CHANNELS))
        tensors["claims"] = torch.zeros_like(tensors["keys"], dtype=torch.uint8)
        tensors["light_shares"] = planes.new_zeros((batch, n_faces if lit else 0, 5))
        in_threads(lambda part: _differentiate(setup, tensors, lit, part), shares(batch, setup.threads))
        light_grad = tensors["light_shares"].sum(dim=1) if lit else None
        return tensors["points_grad"], tensors["attributes_grad"], light_grad, None
