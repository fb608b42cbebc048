"""The losses of eqs. 4-6 between one image and the model, with their gradients."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from samrl_core.inverse.emd import earth_movers
from samrl_core.inverse.information import TargetImage
from samrl_core.inverse.target_cloud import target_cloud
from samrl_core.inverse.thin_mask import clear_of_others, thin_mask
from samrl_core.model.model import Model
from samrl_core.model.renderer import Rendered
from samrl_core.model.target import Reach
from samrl_core.types.camera import Camera
from samrl_core.types.observation import Observation

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
        if reach is not None:
            far = np.linalg.norm(points - reach.center, axis=-1) > reach.radius  # not where NaN
            mask = thin_mask(color, np.where(far, np.inf, depth), mask, frame.mask == 0)
            depth = np.where(far, np.nan, depth)
        clear = None
        if reach is not None:
            clear = clear_of_others(frame.mask, label, mask)
            mask = mask & clear
        rim = 1 if reach is None else 0
        image = TargetImage(color * mask[..., None], depth, mask, rim)
        return RealTarget(image, target_cloud(points, mask, rim), int(mask.sum()), clear)


@dataclass(frozen=True)
class Losses:
    """One evaluation."""

    total: float  # eq. 6 [-]
    color: float  # eq. 4, mean absolute difference per pixel of the real mask, 0..1
    emd: float  # eq. 5 [m]


class TargetRenderer:
    """Renders the target from one camera with the tool arm where its joints say."""

    def __init__(
        self,
        model: Model,
        camera: Camera,
        tool_arm_position: np.ndarray,
        clear: np.ndarray | None = None,
    ) -> None:
        """What the task's parameters move is the target; `clear` as in `RealTarget`."""
        self.model = model
        self.camera = camera
        self.label = model.target_label
        # A thread is all boundary: taking the rim off would leave nothing.
        self.thin = model.chain_reach(tool_arm_position) is not None
        self._tool_arm = tool_arm_position
        shape = (camera.intrinsics.height, camera.intrinsics.width)
        self._clear = np.ones(shape, dtype=bool) if clear is None else clear

    def render(self, values: torch.Tensor, colors: torch.Tensor) -> Rendered:
        """The model's image (eq. 2)."""
        return self.model.render(values, colors, self.camera, self._tool_arm)

    def compared(self, rendered: Rendered) -> torch.Tensor:
        """G_sim x I_sim of eq. 4, (..., H, W, 3)."""
        image = rendered.color * rendered.target[..., None]
        return image * torch.from_numpy(self._clear)[..., None] if self.thin else image

    def image(self, values: np.ndarray, colors: np.ndarray) -> TargetImage:
        """The compared part for values (P,), without gradient."""
        return self.images(values[None], colors)[0]

    def images(self, values: np.ndarray, colors: np.ndarray) -> list[TargetImage]:
        """The same for values (B, P), in one rendering."""
        with torch.no_grad():
            r = self.render(torch.as_tensor(values), torch.as_tensor(colors))
            coverage = r.target.numpy()
            color = self.compared(r).numpy().astype(np.float64)
        if self.thin:  # the mean point would lie between the thread and what is behind it
            depth = r.depth.numpy().astype(np.float64)
            masks = self._thin_mask(coverage, r.label.numpy())
            return [TargetImage(c, d, m, 0) for c, d, m in zip(color, depth, masks, strict=True)]
        # Depth of the pixel's mean point: `Rendered.depth` is that of the nearest sample, which on a slanted
        # face is a quarter of a pixel too near and pushed the estimate away from the camera by 0.4 mm.
        world_in_camera = self.camera.camera_in_world.inverse()
        xyz = r.xyz.numpy().astype(np.float64)
        depth = xyz @ world_in_camera.rotation[2] + world_in_camera.position[2]
        return [TargetImage(c, d, m) for c, d, m in zip(color, depth, coverage > 0.5, strict=True)]

    def cloud(self, rendered: Rendered) -> np.ndarray:
        """X_sim of eq. 5: the target's points (N, 3) in a rendered image, taken as from a real one [m]."""
        if self.thin:
            mask = self._thin_mask(rendered.target.detach().numpy(), rendered.label.numpy())
            depth = np.where(mask, rendered.depth.numpy().astype(np.float64), np.nan)
            return target_cloud(self.camera.unproject(depth), mask, 0)
        mask = rendered.target.detach().numpy() > 0.5
        return target_cloud(rendered.xyz.detach().numpy().astype(np.float64), mask)

    def _thin_mask(self, coverage: np.ndarray, label: np.ndarray) -> np.ndarray:
        """Half of a pixel's samples: as many pixels as a sensor with one sample in each would see."""
        return (coverage >= 0.5) & (label == self.label) & self._clear

    def pixel_motion(self, points: np.ndarray, motion: np.ndarray) -> np.ndarray:
        """How points (N, 3) [m] moved by `motion` (N, 3, P) move in the image, (N, 2, P) [px per unit]."""
        world_in_camera = self.camera.camera_in_world.inverse()
        x, y, z = world_in_camera.apply(points).T
        z = np.maximum(z, 1e-3)[:, None]
        moved = np.einsum("ij,njp->nip", world_in_camera.rotation, motion)
        k = self.camera.intrinsics
        u = k.fx * (moved[:, 0] - x[:, None] / z * moved[:, 2]) / z
        v = k.fy * (moved[:, 1] - y[:, None] / z * moved[:, 2]) / z
        return np.stack([u, v], axis=1)

    def pixel_steps(self, values: np.ndarray, pixels: float) -> np.ndarray:
        """Change of each parameter that moves the fastest point of the target by `pixels` [px], (P,)."""
        points = self.whole_surface(values)
        speed = np.linalg.norm(self.pixel_motion(points, self.motion(values, points)), axis=1).max(axis=0)
        return pixels / np.maximum(speed, 1e-9)

    @property
    def target_groups(self) -> np.ndarray:
        """Which colour groups are the target's (K,)."""
        return self.model.target_groups

    def group_shares(self, values: np.ndarray, colors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What eq. 4 compares, as a linear function of the target's colours.

        Returns:
            Share of each pixel that shows each of the K groups (H, W, K), and what of the image (H, W, 3) is
            left with all of them black: what lies beside the target in pixels that it covers in part.
        """
        groups = self.target_groups
        black = colors.copy()
        black[groups] = 0.0
        rest = self.image(values, black).color
        shares = []
        for first in range(0, len(groups), 3):  # three to a rendering, one in each channel
            some = groups[first : first + 3]
            lit = black.copy()
            lit[some, range(len(some))] = 1.0
            shares.append((self.image(values, lit).color - rest)[..., : len(some)])
        return np.concatenate(shares, axis=-1), rest

    def group_pixels(self, values: np.ndarray, colors: np.ndarray) -> np.ndarray:
        """How many pixels of the target show each colour group (G,): the slope of the summed image."""
        variable = torch.tensor(colors, requires_grad=True)
        r = self.render(torch.as_tensor(values), variable)
        (slope,) = torch.autograd.grad((r.color[..., 0] * r.target.detach()).sum(), variable)
        return slope[:, 0].numpy()

    def motion(self, values: np.ndarray, points: np.ndarray) -> np.ndarray:
        """How points (N, 3) of the target move with the parameters, (N, 3, P), fixed to their part."""
        return self.model.target_frames(values, self._tool_arm).motion(points)

    def visibility(self, values: np.ndarray, colors: np.ndarray) -> float:
        """Share of the target's surface turned to the camera that the image shows, 0..1.

        Judged at the faces' centres, by area as seen; what lies outside the image or behind something,
        the target itself included, is not shown.
        """
        corners = self.model.target_surface(values, self._tool_arm)  # (F, 3, 3)
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])  # twice the area
        centre = corners.mean(axis=1)
        towards = self.camera.camera_in_world.position - centre
        distance = np.linalg.norm(towards, axis=1)
        area = np.maximum(np.einsum("fi,fi->f", normal, towards), 0.0) / distance**3
        if area.sum() <= 0.0:
            return 0.0
        u, v, depth = self.camera.project(centre).T
        k = self.camera.intrinsics
        framed = (depth > 0) & (u >= 0) & (u < k.width) & (v >= 0) & (v < k.height)
        with torch.no_grad():
            seen = self.render(torch.as_tensor(values), torch.as_tensor(colors)).depth.numpy()
        column = np.clip(u, 0, k.width - 1).astype(int)
        row = np.clip(v, 0, k.height - 1).astype(int)
        # A pixel's depth may be that of a neighbouring point of a slanted face: two pixels' worth of slack.
        shown = framed & (depth < seen[row, column] + 0.003 + 2.0 * depth / k.fx)
        return float(area[shown].sum() / area.sum())

    def whole_surface(self, values: np.ndarray) -> np.ndarray:
        """Corners of the target's triangles (N, 3) [m], for when none of it is in the model's image."""
        return np.unique(self.model.target_surface(values, self._tool_arm).reshape(-1, 3), axis=0)


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
        slopes = torch.autograd.grad(loss, (values, colors))
        emd, emd_slope = self._emd(parameters[:count], r, FINE_POINTS)
        gradient = self.color_weight * np.concatenate([slopes[0].numpy(), slopes[1].numpy().ravel()])
        gradient[:count] += self.emd_weight * emd_slope
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
        moved = earth_movers(cloud, self._real.cloud, min(max_points, self.points(cloud)))
        used = moved.matched[:, 0]
        motion = self._renderer.motion(values, cloud[used])
        return moved.value, np.einsum("nc,ncp->p", moved.gradient[used], motion)
