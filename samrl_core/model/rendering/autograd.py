"""What torch sees of the renderer's kernels: one differentiable function from camera points to an image."""

from __future__ import annotations

from typing import Any

import torch

from samrl_core.model.rendering.kernel_types import CHANNELS
from samrl_core.model.rendering.raster_passes import backward_pass, forward_pass
from samrl_core.model.rendering.raster_setup import RasterSetup
from samrl_core.model.rendering.threads import in_threads, shares


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
        float32: dict[str, Any] = {"dtype": torch.float32, "device": points.device}
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
        in_threads(lambda part: forward_pass(setup, tensors, lit, part), shares(batch, setup.threads))
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
        size = tensors["image_grad"].shape[:3]
        tensors["weighted"] = torch.zeros(size, dtype=torch.uint8, device=planes.device)
        tensors["claims"] = torch.zeros_like(tensors["keys"], dtype=torch.uint8)
        tensors["light_shares"] = planes.new_zeros((batch, n_faces if lit else 0, 5))
        in_threads(lambda part: backward_pass(setup, tensors, lit, part), shares(batch, setup.threads))
        light_grad = tensors["light_shares"].sum(dim=1) if lit else None
        return tensors["points_grad"], tensors["attributes_grad"], light_grad, None
