"""Q of the model's image from a camera pose, with the actor's action there (eqs. 12 and 17)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError
from samrl_core.model.model import CameraPose, Model, world_to_camera
from samrl_core.model.real2sim.real2sim import Estimate
from samrl_core.policy.networks.network_image import rendered_image, upright
from samrl_core.policy.networks.networks import SensingQ, SimActor


@dataclass(frozen=True, eq=False)
class Networks:
    """What Learn@Sim has trained for one task."""

    actor: SimActor
    q: SensingQ


class SensingValue:
    """Actor and Q on the model's images of one state; only the camera differs from call to call."""

    def __init__(
        self, model: Model, networks: Networks, estimate: Estimate, tool_arm_position: np.ndarray
    ) -> None:
        """`tool_arm_position` (J,) [rad] is where the tool arm is."""
        self._model, self._networks = model, networks
        self._values = torch.as_tensor(estimate.values)
        self._colors = torch.as_tensor(estimate.colors)
        self._joints = tool_arm_position
        self._tip = model.tip_in_base(tool_arm_position).position

    def image(self, camera: CameraPose) -> torch.Tensor:
        """Network images (B, 6, H, W) from world-to-camera rotations (B, 3, 3) and translations (B, 3).

        Differentiable in both.
        """
        rendered = self._model.render(self._values, self._colors, camera, self._joints)
        return rendered_image(rendered, camera, self._tip, self._model.cell)

    def view(self, camera_in_world: Pose) -> torch.Tensor:
        """The network image (1, 6, H, W) from a camera as it stands, turned with its top up."""
        with torch.no_grad():
            rotation, translation = world_to_camera(camera_in_world)
            return upright(self.image((rotation[None], translation[None])), camera_in_world.rotation)

    def q(self, image: torch.Tensor, through_action: bool = False) -> tuple[torch.Tensor, torch.Tensor]:
        """See `value_of`."""
        return value_of(self._networks, image, through_action)


def value_of(
    networks: Networks, image: torch.Tensor, through_action: bool = False
) -> tuple[torch.Tensor, torch.Tensor]:
    """Eq. 12 and Q of it: returns (B,) and actions (B, 3) [m] of images (B, 6, H, W).

    Args:
        image: network images with the camera's top up.
        through_action: False: the gradient takes the action as given, eq. 17; True: as the actor's, so
            that it is the gradient of what line 10 compares.

    Raises:
        InputError: an output of the networks is not finite.
    """
    action = networks.actor(image)
    value = networks.q(image, action if through_action else action.detach())
    if not (torch.isfinite(action).all() and torch.isfinite(value).all()):
        raise InputError(f"networks gave action {action.tolist()} and Q {value.tolist()}; train them anew")
    return value, action
