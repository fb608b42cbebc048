"""Launches of the renderer's kernels: the forward pass of some images, and the backward pass."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any

import torch
import warp as wp

from samrl_core.model.rendering import cut_kernels, edge_kernels, light_kernels, raster_kernels, shade_kernels
from samrl_core.model.rendering.kernel_types import LightRow, Pixel
from samrl_core.model.rendering.raster_setup import RasterSetup

_GATHERED = 16  # pixels of a row that one GPU thread sums up before it adds to a triangle
_STRIPS = 32  # GPU threads that share a triangle of a single image: a table fills half of one

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
    "weighted": wp.uint8,
    "corners": Pixel,
}


def _launch(setup: RasterSetup, kernel: Any, dim: tuple[int, ...], inputs: list[Any]) -> None:
    wp.launch(kernel, dim=dim, inputs=inputs, device=setup.device, record_tape=False)


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


def forward_pass(setup: RasterSetup, tensors: dict[str, torch.Tensor], lit: bool, images: slice) -> None:
    """Forward pass of some images, by the light that is on them, if they are `lit`.

    The tensors are those of `Rasterize.forward` by name; what is made is written into them.
    """
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


def backward_pass(setup: RasterSetup, tensors: dict[str, torch.Tensor], lit: bool, images: slice) -> None:
    """Backward pass of some images: shading at the visible samples, then everything that jumps.

    The tensors are what the forward pass kept, and their gradients under `x_grad`, which are added to.
    """
    t = _views(tensors, images)
    batch, n_faces = t.batch, setup.faces.shape[0]
    shading = [t.planes, setup.faces, t.attributes, t.brightness]
    pixels = (batch, setup.height, setup.width)
    _launch_rows(setup, shade_kernels.mark_weighted, pixels, _GATHERED, [t.image_grad, t.weighted])
    inputs = [*shading, setup.samples, t.keys, t.image_grad, t.weighted, t.planes_grad, t.corners_grad]
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
        t.weighted,
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
        t.weighted,
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
