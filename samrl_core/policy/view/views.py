"""Camera poses on a task's view region: sampled at random, or differentiable in three coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from samrl_core.cell.tasks.task import ViewRegion
from samrl_core.common.errors import InputError
from samrl_core.model.model import CameraPose

COORDINATES = 6  # azimuth, elevation, distance, and the point on the optical axis


@dataclass(frozen=True)
class ViewSettings:
    """How far the optical axes of sampled views pass the region's target."""

    look_jitter: float = 0.01  # of the point on the optical axis, per axis, standard deviation [m]

    def __post_init__(self) -> None:
        if not self.look_jitter >= 0.0:
            raise InputError(f"look_jitter is {self.look_jitter} m, must be at least 0")


def sample_views(
    region: ViewRegion, rng: np.random.Generator, count: int, settings: ViewSettings | None = None
) -> np.ndarray:
    """Views uniform in azimuth, elevation and distance, (count, 6): these three, then the point on the axis.

    Args:
        region: the shell.
        rng: source of the views.
        count: how many.
        settings: of the jitter.

    Returns:
        Azimuth and elevation [rad], distance from the point on the axis [m], that point in world [m].
    """
    s = settings or ViewSettings()
    lower, upper = np.transpose([region.azimuth, region.elevation, region.distance])
    shell = rng.uniform(lower, upper, (count, 3))
    return np.hstack([shell, region.target + s.look_jitter * rng.standard_normal((count, 3))])


def camera_from(
    azimuth: torch.Tensor, elevation: torch.Tensor, distance: torch.Tensor, target: torch.Tensor
) -> CameraPose:
    """World-to-camera rotation (..., 3, 3) and translation (..., 3) [m] of cameras that look at a point.

    Image up is world up (`types.pose.look_at` with roll 0), in closed form and differentiable in all four.

    Args:
        azimuth: (...) about world z, 0 along +x [rad].
        elevation: (...) above the horizon; below 90 degrees [rad].
        distance: (...) between camera and target [m].
        target: (..., 3) in world [m].
    """
    ca, sa, ce, se = azimuth.cos(), azimuth.sin(), elevation.cos(), elevation.sin()
    outwards = torch.stack([ce * ca, ce * sa, se], dim=-1)  # from the target to the camera
    right = torch.stack([-sa, ca, torch.zeros_like(sa)], dim=-1)
    down = torch.stack([se * ca, se * sa, -ce], dim=-1)
    rotation = torch.stack([right, down, -outwards], dim=-2)
    eye = target + distance.unsqueeze(-1) * outwards
    return rotation, -(rotation @ eye.unsqueeze(-1)).squeeze(-1)


def cameras_of(views: np.ndarray | torch.Tensor) -> CameraPose:
    """The cameras of views (..., 6) as `sample_views` gives them."""
    v = torch.as_tensor(views)
    if v.shape[-1] != COORDINATES:
        raise InputError(f"views have shape {tuple(v.shape)}, the last axis must be {COORDINATES} long")
    return camera_from(v[..., 0], v[..., 1], v[..., 2], v[..., 3:])
