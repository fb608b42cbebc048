"""How channels of an image move as its camera does, where the scene is at rest.

A point of the scene has the same colour and the same XYZ wherever the camera is: from one camera pose to the
next its values only move through the image (brightness constancy, Horn and Schunck 1981). So

    df/dpose = -(df/du du/dpose + df/dv dv/dpose),

with f a channel as the networks see it, clipped and 0 where nothing is seen, and (u, v) the pixel of the
point. On a silhouette it is the nearer side that moves the border, so its depth counts there.
"""

from __future__ import annotations

import torch
from torch.nn import functional

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.model.model import CameraPose


def moved_by_camera(
    channels: torch.Tensor, depth: torch.Tensor, camera: CameraPose, lens: Intrinsics
) -> torch.Tensor:
    """The channels as they are, with their gradient by the camera's pose.

    Args:
        channels: (..., C, H, W); their own gradients are left out.
        depth: (..., H, W) of the nearest surface along the optical axis [m], inf where nothing is seen.
        camera: world-to-camera rotation (..., 3, 3) and translation (..., 3) [m] that the image is of.
        lens: that it was taken with.
    """
    rotation, translation = (part.to(channels) for part in camera)
    still = channels.detach()
    near = torch.where(torch.isfinite(depth), 1.0 / depth, torch.zeros_like(depth)).detach().to(channels)
    count = (-1, 1, *near.shape[-2:])
    total = still
    for axis, (size, padding) in enumerate((((1, 3), (0, 1)), ((3, 1), (1, 0)))):
        # Along a row, then along a column: the nearest of the three pixels whose difference is taken.
        front = functional.max_pool2d(near.reshape(count), size, stride=1, padding=padding)
        motion = _pixel_motion(front.reshape(near.shape), (rotation, translation), lens, axis)
        total = total - _difference(still, -1 - axis) * motion.unsqueeze(-3)
    return total


def _difference(channels: torch.Tensor, dimension: int) -> torch.Tensor:
    """Central differences along an axis of the image [1/px]; one-sided at its borders."""
    return torch.gradient(channels, dim=dimension)[0]


def _pixel_motion(
    inverse_depth: torch.Tensor, camera: CameraPose, lens: Intrinsics, axis: int
) -> torch.Tensor:
    """Zero (..., H, W) with the gradient of where each pixel's point is seen along an axis [px].

    Args:
        inverse_depth: (..., H, W) [1/m], 0 where nothing is seen and so nothing moves.
        camera: as above, with gradients.
        lens: of the image.
        axis: 0 along a row, 1 along a column.
    """
    rotation, translation = camera
    dtype, device = inverse_depth.dtype, inverse_depth.device
    x = (torch.arange(lens.width, dtype=dtype, device=device) + 0.5 - lens.cx) / lens.fx
    y = (torch.arange(lens.height, dtype=dtype, device=device) + 0.5 - lens.cy) / lens.fy
    grid_y, grid_x = torch.meshgrid(y, x, indexing="ij")
    seen = inverse_depth > 0
    depth = 1.0 / torch.where(seen, inverse_depth, torch.ones_like(inverse_depth))
    local = torch.stack([grid_x.expand_as(depth), grid_y.expand_as(depth), torch.ones_like(depth)], dim=-1)
    local = local * depth.unsqueeze(-1)
    from_eye = local - translation.detach()[..., None, None, :]
    world = torch.einsum("...hwi,...ij->...hwj", from_eye, rotation.detach())  # rows: R^T (p - t)
    again = torch.einsum("...hwj,...ij->...hwi", world, rotation) + translation[..., None, None, :]
    place = (lens.fx, lens.fy)[axis] * again[..., axis] / again[..., 2]
    return torch.where(seen, place - place.detach(), torch.zeros_like(place))
