"""RGB-D images as they are stored, 5 bytes a pixel, and how they become what the networks see.

XYZ is worked out from depth and the camera's pose: stored as float32 it would be five times as much.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch

from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError
from samrl_core.policy.networks.network_image import network_image, upright
from samrl_core.policy.networks.surface import world_points

DEPTH_UNIT = 1e-4  # [m] per count of a stored depth; 0 is unmeasured
DEPTH_LIMIT = 6.5535  # [m], the largest count of 16 bits


def packed_depth(depth: np.ndarray) -> np.ndarray:
    """Depth (..., H, W) [m], NaN where unmeasured, to uint16 counts of 0.1 mm; beyond 6.5535 m unmeasured.

    Raises:
        InputError: a depth is negative.
    """
    depth = np.asarray(depth, dtype=np.float64)
    known = np.isfinite(depth) & (depth <= DEPTH_LIMIT)
    if bool((depth[known] < 0).any()):
        raise InputError(f"depth of {depth[known].min():.4f} m is negative; NaN means unmeasured")
    return np.round(np.where(known, depth, 0.0) / DEPTH_UNIT).astype(np.uint16)


def poses_as_rows(poses: Sequence[Pose]) -> np.ndarray:
    """Position [m] and quaternion xyzw of each pose, (N, 7)."""
    return np.stack([np.concatenate([pose.position, pose.quat_xyzw]) for pose in poses])


def network_images(
    color: np.ndarray,
    depth: np.ndarray,
    camera_rows: np.ndarray,
    tip_in_base: np.ndarray,
    cell: CellSpec,
    device: torch.device | str = "cpu",
) -> torch.Tensor:
    """Stored images to network images (B, 6, H, W) float32, as `observed_image` makes them.

    Args:
        color: (B, H, W, 3) uint8.
        depth: (B, H, W) uint16, see `packed_depth`.
        camera_rows: (B, 7) poses of the optical frame in world, see `poses_as_rows`.
        tip_in_base: (B, 3) tool tip in the tool arm's base frame [m].
        cell: calibration; its intrinsics took the images.
        device: where the images shall be.

    Raises:
        InputError: the images are not of the cell's size.
    """
    k = cell.intrinsics
    if depth.shape[1:] != (k.height, k.width) or color.shape != (*depth.shape, 3):
        raise InputError(
            f"stored images are {color.shape} and {depth.shape}, the cell's camera takes "
            f"{k.width}x{k.height} px; use data that were taken with this camera"
        )
    rotation = np.stack([Pose(row[:3], row[3:]).rotation for row in camera_rows])
    tip_in_world = torch.from_numpy(cell.tool_base_in_world.apply(tip_in_base)).to(device)
    counts = torch.from_numpy(depth.astype(np.int32)).to(device)
    metres = counts.double() * DEPTH_UNIT  # in float64: XYZ in world cancels against the tip
    position = torch.from_numpy(np.ascontiguousarray(camera_rows[:, :3])).to(device)
    xyz = world_points(metres, torch.from_numpy(rotation).to(device), position, k)
    paint = torch.from_numpy(color).to(device).double() / 255.0
    return upright(network_image(paint, xyz, counts > 0, tip_in_world, cell.tool_base_in_world), rotation)
