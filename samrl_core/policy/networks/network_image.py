"""Input of the networks: colour, and each pixel's point relative to the tool tip.

The paper's RGB-XYZ image with XYZ relative to the tip: the same picture then asks for the same action
wherever in the cell it is taken. The tip comes from measured joints and the camera's pose from calibration,
which a real cell has too.
"""

from __future__ import annotations

import numpy as np
import torch

from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.types.observation import Observation
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError
from samrl_core.model.model import CameraPose
from samrl_core.model.rendering.renderer import Rendered
from samrl_core.policy.networks.image_motion import moved_by_camera
from samrl_core.policy.networks.surface import nearest_points

CHANNELS = 6
XYZ = slice(3, 6)  # of the channels
XYZ_UNIT = 0.1  # [m] per unit of an XYZ channel
XYZ_CLIP = 3.0  # an XYZ channel is within +- this: farther points are as far
COLOR_CENTER = 0.5
COLOR_UNIT = 0.25  # about the standard deviation of colours that fill 0..1


def network_image(
    color: torch.Tensor,
    xyz_in_world: torch.Tensor,
    valid: torch.Tensor,
    tip_in_world: torch.Tensor,
    base_in_world: Pose,
) -> torch.Tensor:
    """Input of all networks, (..., 6, H, W) float32; differentiable in colour, XYZ and tip.

    Channels 0-2 are (colour - 0.5) / 0.25. Channels 3-5 are the point less the tip, in the axes of the tool
    arm's base, in units of 0.1 m, clipped to +-3, and exactly 0 where there is no valid point.

    Args:
        color: (..., H, W, 3) linear RGB, 0..1.
        xyz_in_world: (..., H, W, 3) [m]; any value, NaN too, where `valid` is not set.
        valid: (..., H, W), above 0 or True where the pixel's point is known.
        tip_in_world: (..., 3) tool tip [m].
        base_in_world: base of the tool arm.

    Raises:
        InputError: shapes that do not fit, or a tip, a colour or a valid point that is not finite.
    """
    if color.shape != xyz_in_world.shape or color.shape[:-1] != valid.shape or color.shape[-1] != 3:
        raise InputError(
            f"colour {tuple(color.shape)}, XYZ {tuple(xyz_in_world.shape)} and valid {tuple(valid.shape)} do "
            f"not fit; they must be (..., H, W, 3) twice and (..., H, W)"
        )
    known = (valid > 0).unsqueeze(-1)
    rotation = torch.as_tensor(base_in_world.rotation, dtype=xyz_in_world.dtype, device=xyz_in_world.device)
    # Filled before the arithmetic: 0 times NaN would be NaN in the gradient, too.
    points = torch.where(known, xyz_in_world, torch.zeros_like(xyz_in_world))
    tip = tip_in_world.to(points)[..., None, None, :]
    from_tip = ((points - tip) @ rotation / XYZ_UNIT).clamp(-XYZ_CLIP, XYZ_CLIP)  # rows: R^T (p - tip)
    from_tip = torch.where(known, from_tip, torch.zeros_like(from_tip))
    paint = (color - COLOR_CENTER) / COLOR_UNIT
    image = torch.cat([paint.to(torch.float32), from_tip.to(torch.float32)], dim=-1).movedim(-1, -3)
    if not bool(torch.isfinite(image.detach()).all()):
        raise InputError("colour, tip or a valid point is not finite; mark unmeasured pixels as not valid")
    return image


def observed_image(observation: Observation, tip_in_base: np.ndarray, cell: CellSpec) -> torch.Tensor:
    """The same of a real image, (6, H, W), upright; colours as Real2Sim takes them.

    Args:
        observation: from the cell.
        tip_in_base: (3,) tool tip in the tool arm's base frame, from the observation's joints [m].
        cell: calibration.

    Raises:
        InputError: the camera's intrinsics are not the cell's.
    """
    if observation.camera.intrinsics != cell.intrinsics:
        raise InputError(f"camera has {observation.camera.intrinsics}, the cell's is {cell.intrinsics}")
    points = observation.camera.unproject(observation.frame.depth.astype(np.float64))
    image = network_image(
        torch.from_numpy(observation.frame.color / 255.0),
        torch.from_numpy(points),
        torch.from_numpy(np.isfinite(observation.frame.depth)),
        _tip_in_world(tip_in_base, cell),
        cell.tool_base_in_world,
    )
    return upright(image, observation.camera.camera_in_world.rotation)


def upright(image: torch.Tensor, camera_rotation: np.ndarray) -> torch.Tensor:
    """Images (..., C, H, W) as a camera with its top up takes them: turned by half where the top is down.

    The arm takes many views only with its camera turned over. With the principal point in the image's middle
    that picture is the other one turned by half: the networks need to know one of the two alone.

    Args:
        image: as the camera took it.
        camera_rotation: (..., 3, 3) of the camera's optical axes in world.
    """
    top_is_down = torch.as_tensor(camera_rotation[..., 2, 1] > 0.0, device=image.device)
    return torch.where(top_is_down[..., None, None, None], image.flip((-2, -1)), image)


def rendered_image(
    rendered: Rendered, camera: CameraPose, tip_in_base: np.ndarray, cell: CellSpec
) -> torch.Tensor:
    """The same of the model's image or images, (..., 6, H, W) on the images' device.

    Differentiable in the camera: colours through the renderer, XYZ as `moved_by_camera` has it. As the camera
    stands: `upright` is for the caller, who knows its pose.

    Args:
        rendered: one image or a batch.
        camera: world-to-camera rotation (..., 3, 3) and translation (..., 3) [m] that it was taken with.
        tip_in_base: (3,) or (..., 3) tool tip in the tool arm's base frame [m].
        cell: calibration.
    """
    image = network_image(
        rendered.color,
        nearest_points(rendered, camera, cell.intrinsics),
        torch.isfinite(rendered.depth),
        _tip_in_world(tip_in_base, cell).to(rendered.xyz.device),
        cell.tool_base_in_world,
    )
    if not any(part.requires_grad for part in camera):
        return image
    xyz = moved_by_camera(image[..., XYZ, :, :], rendered.depth, camera, cell.intrinsics)
    return torch.cat([image[..., : XYZ.start, :, :], xyz], dim=-3)


def _tip_in_world(tip_in_base: np.ndarray, cell: CellSpec) -> torch.Tensor:
    return torch.from_numpy(cell.tool_base_in_world.apply(np.asarray(tip_in_base, dtype=np.float64)))
