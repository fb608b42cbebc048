"""The losses of eqs. 4-6 between one image and the model, with their gradients."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from samrl_core.cell.types.observation import Observation
from samrl_core.model.real2sim.emd import earth_movers
from samrl_core.model.real2sim.information import TargetImage
from samrl_core.model.real2sim.target_cloud import target_cloud
from samrl_core.model.real2sim.target_renderer import TargetRenderer
from samrl_core.model.real2sim.thin_mask import clear_of_others, thin_mask
from samrl_core.model.rendering.renderer import Rendered
from samrl_core.model.scene.target import Reach

FINE_POINTS = 128  # of each cloud in eq. 5; four times fewer cost a tenth of 256 and cover the block at 10 mm
COARSE_POINTS = 64


@dataclass(frozen=True, eq=False)
class RealTarget:
    """The target as the sensors saw it."""

    image: TargetImage  # colour is mask x colour (G_real x I_real of eq. 4), depth NaN where unmeasured
    cloud: np.ndarray  # (N, 3) in world [m]
    pixels: int  # of the mask
    clear: np.ndarray | None = None  # (H, W) bool, what of the image is compared; None: all of it

    @staticmethod
    def of(observation: Observation, label: int, reach: Reach | None = None) -> RealTarget:
        """Cut the target with `label` out of an observation; with `reach` it is a thin one."""
        frame = observation.frame
        mask = frame.mask == label
        color = frame.color / 255.0
        depth = frame.depth.astype(np.float64)
        points = observation.camera.unproject(depth)
        clear, rim = None, 1
        if reach is not None:
            far = np.linalg.norm(points - reach.center, axis=-1) > reach.radius  # not where NaN
            mask = thin_mask(color, np.where(far, np.inf, depth), mask, frame.mask == 0)
            depth = np.where(far, np.nan, depth)
            clear, rim = clear_of_others(frame.mask, label, mask), 0
            mask = mask & clear
        image = TargetImage(color * mask[..., None], depth, mask, rim)
        return RealTarget(image, target_cloud(points, mask, rim), int(mask.sum()), clear)


@dataclass(frozen=True)
class Losses:
    """One evaluation."""

    total: float  # eq. 6 [-]
    color: float  # eq. 4, mean absolute difference per pixel of the real mask, 0..1
    emd: float  # eq. 5 [m]

    def farther_than(self, before: Losses, times: float) -> bool:
        """Whether points and colours both are more than so many times as far off; either may have been 0."""
        return self.emd > times * before.emd and self.color > times * before.color


class Misfit:
    """Objectives for `minimize`."""

    def __init__(
        self, renderer: TargetRenderer, real: RealTarget, color_weight: float, emd_weight: float
    ) -> None:
        """Weights are lambda_1 [-] and lambda_2 [1/m] of eq. 6."""
        self._renderer = renderer
        self._real = real
        self._real_color = torch.as_tensor(real.image.color, dtype=torch.float32)
        self.color_weight = color_weight
        self.emd_weight = emd_weight

    def points(self, cloud: np.ndarray) -> int:
        """How many points of each cloud eq. 5 takes.

        Of a thin target half of the smaller cloud at most: thinning then evens out both clouds' densities,
        which differ where depth was not measured and would pull points along the thread.
        """
        fewer = min(len(cloud), len(self._real.cloud))
        return min(FINE_POINTS, max(1, fewer // 2)) if self._renderer.thin else FINE_POINTS

    def losses(self, values: np.ndarray, colors: np.ndarray) -> Losses:
        """Eqs. 4 to 6 without gradient."""
        with torch.no_grad():
            r = self._renderer.render(torch.as_tensor(values), torch.as_tensor(colors))
            color = self.color_loss(r).item()
            emd, _ = self._emd(values, r, FINE_POINTS)
        return Losses(self.color_weight * color + self.emd_weight * emd, color, emd)

    def coarse(self, values: np.ndarray) -> tuple[float, np.ndarray]:
        """Eq. 5 alone: [m] and its gradient (P,)."""
        with torch.no_grad():
            colors = torch.as_tensor(self._renderer.model.initial_colors())
            r = self._renderer.render(torch.as_tensor(values), colors)
        return self._emd(values, r, COARSE_POINTS)

    def fine(self, parameters: np.ndarray) -> tuple[float, np.ndarray]:
        """Eq. 6 and its gradient by values (P,) and colours (G * 3,), stacked."""
        count = len(self._renderer.model.task.parameters())
        values = torch.tensor(parameters[:count], requires_grad=True)
        colors = torch.tensor(parameters[count:].reshape(-1, 3), requires_grad=True)
        r = self._renderer.render(values, colors)
        loss = self.color_loss(r)
        gradients = torch.autograd.grad(loss, (values, colors))
        emd, emd_gradient = self._emd(parameters[:count], r, FINE_POINTS)
        gradient = self.color_weight * np.concatenate([gradients[0].numpy(), gradients[1].numpy().ravel()])
        gradient[:count] += self.emd_weight * emd_gradient
        return self.color_weight * loss.item() + self.emd_weight * emd, gradient

    def color_loss(self, rendered: Rendered) -> torch.Tensor:
        """Eq. 4 of a rendered image, per pixel of the real mask, 0..1."""
        return (self._renderer.compared(rendered) - self._real_color).abs().mean(
            dim=-1
        ).sum() / self._real.pixels

    def _emd(self, values: np.ndarray, rendered, max_points: int) -> tuple[float, np.ndarray]:
        cloud = self._renderer.cloud(rendered)
        if len(cloud) < 8:  # out of sight in the model: pull with the whole body instead
            cloud = self._renderer.whole_surface(values)
        compared = self._renderer.compared_points(cloud)
        moved = earth_movers(compared, self._real.cloud, min(max_points, self.points(cloud)))
        used = moved.matched[:, 0]
        motion = self._renderer.compared_motion(self._renderer.motion(values, cloud[used]))
        return moved.value, np.einsum("nc,ncp->p", moved.gradient[used], motion)
