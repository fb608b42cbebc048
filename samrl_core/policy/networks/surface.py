"""Surface points of an image: one point per pixel, as a depth camera reports it.

The renderer's XYZ is the mean over a pixel. On a silhouette that point lies between both sides, where nothing
is; of a thread two pixels wide half of the pixels are such. The networks see the nearest surface instead.
"""

from __future__ import annotations

import torch

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.model.model import CameraPose
from samrl_core.model.rendering.renderer import Rendered


def world_points(
    depth: torch.Tensor, camera_in_world: torch.Tensor, position: torch.Tensor, lens: Intrinsics
) -> torch.Tensor:
    """Points (..., H, W, 3) in world [m] of depth images.

    Args:
        depth: (..., H, W) along the optical axis [m].
        camera_in_world: rotations (..., 3, 3), columns are the camera's axes.
        position: (..., 3) of the cameras in world [m].
        lens: of all of them.
    """
    u = (torch.arange(lens.width, dtype=depth.dtype, device=depth.device) + 0.5 - lens.cx) / lens.fx
    v = (torch.arange(lens.height, dtype=depth.dtype, device=depth.device) + 0.5 - lens.cy) / lens.fy
    grid_v, grid_u = torch.meshgrid(v, u, indexing="ij")
    rays = torch.stack([grid_u, grid_v, torch.ones_like(grid_u)], dim=-1)  # of unit depth
    points = rays * depth[..., None]
    return torch.einsum("...hwi,...ji->...hwj", points, camera_in_world) + position[..., None, None, :]


def nearest_points(rendered: Rendered, camera: CameraPose, lens: Intrinsics) -> torch.Tensor:
    """Point of each pixel's nearest surface, (..., H, W, 3) in world [m]; 0 where the pixel shows nothing.

    The depth of the nearest sample on the pixel's ray, which is what `observed_image` has of a real camera;
    without gradient, see `image_motion`.

    Args:
        rendered: one image or a batch.
        camera: world-to-camera rotation (..., 3, 3) and translation (..., 3) [m] that it was taken with.
        lens: that it was taken with.
    """
    rotation, translation = (part.detach().to(rendered.xyz.device, torch.float64) for part in camera)
    valid = torch.isfinite(rendered.depth)
    depth = torch.where(valid, rendered.depth, torch.zeros_like(rendered.depth)).detach().double()
    position = -(rotation.mT @ translation[..., None])[..., 0]
    found = torch.where(valid[..., None], world_points(depth, rotation.mT, position, lens), 0.0)
    return found.to(rendered.xyz.dtype)
