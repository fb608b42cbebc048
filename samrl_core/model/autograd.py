"""The only bridge between Warp and torch: one differentiable function from camera points to an image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import torch
import warp as wp

from samrl_core.model import edge_kernels, raster_kernels
from samrl_core.model.kernel_types import CHANNELS, EdgeRow, Pixel
from samrl_core.warp_runtime import start


@dataclass(frozen=True, eq=False)
class RasterSetup:
    """What stays the same between images: connectivity and lens, on one device."""

    device: str
    faces: Any  # wp.array (F, 3) int32
    face_label: Any  # wp.array (F,) int32
    edges: Any  # wp.array (E,) of 8 int32
    lens: Any  # raster_kernels.Lens
    width: int  # [px]
    height: int  # [px]
    samples: int  # per pixel and direction
    edge_step: float  # [px]
    background: Any  # Pixel


def make_setup(
    faces: torch.Tensor,
    face_label: torch.Tensor,
    edges: torch.Tensor,
    lens: tuple[float, float, float, float, float],
    size: tuple[int, int],
    samples: int,
    edge_step: float,
    background: tuple[float, float, float],
    device: str,
) -> RasterSetup:
    """Copies connectivity to the device.

    Args:
        faces: (F, 3) int32. face_label: (F,) int32. edges: (E, 8) int32 as in `edge_kernels`.
        lens: fx, fy, cx, cy [px], near [m].
        size: width, height [px].
        samples: per pixel and direction.
        edge_step: longest step of the edge integral [px].
        background: linear RGB where nothing is drawn.
        device: torch and Warp name of the device.
    """
    start()
    where = torch.device(device)
    lens_struct = raster_kernels.Lens()
    lens_struct.fx, lens_struct.fy, lens_struct.cx, lens_struct.cy, lens_struct.near = lens
    return RasterSetup(
        device=str(wp.device_from_torch(where)),
        faces=wp.from_torch(faces.to(where).contiguous(), dtype=wp.int32),
        face_label=wp.from_torch(face_label.to(where).contiguous(), dtype=wp.int32),
        edges=wp.from_torch(edges.to(where).contiguous(), dtype=EdgeRow),
        lens=lens_struct,
        width=size[0],
        height=size[1],
        samples=samples,
        edge_step=edge_step,
        background=Pixel(*background, 0.0, 0.0, 0.0, 0.0),
    )


class Rasterize(torch.autograd.Function):
    """Image, depth and label from points in camera coordinates and values per vertex.

    `Rasterize.apply(points (B, V, 3) [m], attributes (B, V, 7), setup)` returns image (B, H, W, 7),
    depth (B, H, W) [m] and label (B, H, W) int32. Gradients flow through the image to both tensors.
    """

    @staticmethod
    def forward(ctx: Any, points: torch.Tensor, attributes: torch.Tensor, setup: RasterSetup) -> Any:
        """Rasterise and shade; keeps the z-buffer for the backward pass."""
        points, attributes = points.detach().contiguous(), attributes.detach().contiguous()
        batch, where = points.shape[0], points.device
        n_faces, s = setup.faces.shape[0], setup.samples
        height, width = setup.height, setup.width
        planes = torch.zeros((batch, n_faces, 3, 3), dtype=torch.float32, device=where)
        boxes = torch.empty((batch, n_faces, 4), dtype=torch.float32, device=where)
        keys = torch.zeros((batch, height * s, width * s), dtype=torch.int64, device=where)
        image = torch.empty((batch, height, width, CHANNELS), dtype=torch.float32, device=where)
        depth = torch.empty((batch, height, width), dtype=torch.float32, device=where)
        label = torch.empty((batch, height, width), dtype=torch.int32, device=where)
        w_points = wp.from_torch(points, dtype=wp.vec3)
        w_attributes = wp.from_torch(attributes, dtype=Pixel)
        w_planes = wp.from_torch(planes, dtype=wp.mat33)
        w_boxes = wp.from_torch(boxes, dtype=wp.vec4)
        w_keys = wp.from_torch(keys, dtype=wp.int64)
        wp.launch(
            raster_kernels.set_up_triangles,
            dim=(batch, n_faces),
            inputs=[w_points, setup.faces, setup.lens, width, height, w_planes, w_boxes],
            device=setup.device,
            record_tape=False,
        )
        wp.launch(
            raster_kernels.rasterize,
            dim=(batch, n_faces),
            inputs=[w_planes, w_boxes, setup.lens.near, s, w_keys],
            device=setup.device,
            record_tape=False,
        )
        wp.launch(
            raster_kernels.shade,
            dim=(batch, height, width),
            inputs=[
                w_planes,
                setup.faces,
                w_attributes,
                setup.face_label,
                setup.background,
                s,
                w_keys,
                wp.from_torch(image, dtype=Pixel),
                wp.from_torch(depth, dtype=wp.float32),
                wp.from_torch(label, dtype=wp.int32),
            ],
            device=setup.device,
            record_tape=False,
        )
        ctx.save_for_backward(points, attributes, planes, keys)
        ctx.setup = setup
        ctx.mark_non_differentiable(depth, label)
        return image, depth, label

    @staticmethod
    def backward(ctx: Any, *grads: torch.Tensor | None) -> Any:
        """Adjoint of shading at the visible samples, then the edge integral."""
        points, attributes, planes, keys = ctx.saved_tensors
        setup: RasterSetup = ctx.setup
        image_grad = grads[0]
        if image_grad is None:
            return None, None, None
        image_grad = image_grad.contiguous()
        batch, height, width = image_grad.shape[:3]
        n_faces = setup.faces.shape[0]
        planes_grad = torch.zeros_like(planes)
        corner_grad = planes.new_zeros((batch, n_faces, 3, CHANNELS))
        points_grad = torch.zeros_like(points)
        attributes_grad = torch.zeros_like(attributes)
        w_points = wp.from_torch(points, dtype=wp.vec3)
        w_attributes = wp.from_torch(attributes, dtype=Pixel)
        w_planes = wp.from_torch(planes, dtype=wp.mat33)
        w_keys = wp.from_torch(keys, dtype=wp.int64)
        w_image_grad = wp.from_torch(image_grad, dtype=Pixel)
        w_planes_grad = wp.from_torch(planes_grad, dtype=wp.mat33)
        w_corner_grad = wp.from_torch(corner_grad, dtype=Pixel)
        w_points_grad = wp.from_torch(points_grad, dtype=wp.vec3)
        wp.launch(
            raster_kernels.shade_adjoint,
            dim=(batch, height, width),
            inputs=[
                w_planes,
                setup.faces,
                w_attributes,
                setup.samples,
                w_keys,
                w_image_grad,
                w_planes_grad,
                w_corner_grad,
            ],
            device=setup.device,
            record_tape=False,
        )
        wp.launch(
            raster_kernels.triangles_adjoint,
            dim=(batch, n_faces),
            inputs=[
                w_points,
                setup.faces,
                setup.lens,
                w_planes_grad,
                w_corner_grad,
                w_points_grad,
                wp.from_torch(attributes_grad, dtype=Pixel),
            ],
            device=setup.device,
            record_tape=False,
        )
        wp.launch(
            edge_kernels.integrate_edges,
            dim=(batch, setup.edges.shape[0]),
            inputs=[
                w_points,
                w_planes,
                setup.faces,
                w_attributes,
                setup.edges,
                setup.background,
                setup.lens,
                setup.samples,
                setup.edge_step,
                w_keys,
                w_image_grad,
                w_points_grad,
            ],
            device=setup.device,
            record_tape=False,
        )
        return points_grad, attributes_grad, None
