"""Renders the target of a task from one image's camera, and how its points move there."""

from __future__ import annotations

import numpy as np
import torch

from samrl_core.cell.tasks.task import ParameterSpec
from samrl_core.cell.types.camera import Camera
from samrl_core.cell.types.scene import Capsule
from samrl_core.common.errors import InputError
from samrl_core.model.model import Model
from samrl_core.model.real2sim.information import TargetImage
from samrl_core.model.real2sim.target_cloud import target_cloud
from samrl_core.model.rendering.renderer import Rendered
from samrl_core.model.rendering.window import Window


class TargetRenderer:
    """Renders the target from one camera, with the tool arm at given joint positions."""

    def __init__(
        self,
        model: Model,
        camera: Camera,
        tool_arm_position: np.ndarray,
        clear: np.ndarray | None = None,
        part: int = 0,
        others: np.ndarray | None = None,
        taken: np.ndarray | None = None,
        plane: float = 0.0,
    ) -> None:
        """One part of what the task's parameters move is the target; `clear` as in `RealTarget`.

        Where there are several parts, values are those of the parameters `taken` (Q,), by default those that
        move this one (`TargetPart.parameters`), and `others` (P,) has those of the rest. With a `plane` above
        0, clouds are compared as they are seen, all points at that depth [m]: depth may be too poor to match.
        """
        self._plane = plane
        self._axis = camera.camera_in_world.rotation[:, 2]  # optical, in world
        self.model = model
        self.camera = camera
        self.part, which = model.parts[part], part
        self.label = self.part.label
        # A thread is all boundary: taking the rim off would leave nothing.
        self.thin = self.part.is_chain
        self._which = which
        self.taken = self.part.parameters if taken is None else taken
        self._others = None if others is None or len(model.parts) == 1 else torch.tensor(others)
        self._tool_arm = tool_arm_position
        shape = (camera.intrinsics.height, camera.intrinsics.width)
        self._clear = np.ones(shape, dtype=bool) if clear is None else clear

    def render(self, values: torch.Tensor, colors: torch.Tensor) -> Rendered:
        """The model's image (eq. 2)."""
        return self.model.render(self._whole(values), colors, self.camera, self._tool_arm, self._which)

    @property
    def specs(self) -> tuple[ParameterSpec, ...]:
        """Of the values that this part takes."""
        specs = self.model.task.parameters()
        return specs if self._others is None else tuple(specs[k] for k in self.taken)

    def _whole(self, values: torch.Tensor) -> torch.Tensor:
        """The task's values (..., P) of the part's."""
        if self._others is None:
            return values
        whole = self._others.repeat(*values.shape[:-1], 1) if values.ndim > 1 else self._others.clone()
        whole[..., torch.from_numpy(self.taken)] = values
        return whole

    def _whole_values(self, values: np.ndarray) -> np.ndarray:
        return values if self._others is None else self._whole(torch.as_tensor(values)).numpy()

    def compared(self, rendered: Rendered) -> torch.Tensor:
        """G_sim x I_sim of eq. 4, (..., H, W, 3).

        Where the target of colour T covers the share c of a pixel and B lies beside it, that is c times the
        pixel's mean colour c T + (1 - c) B: coverage counts twice, on purpose.
        """
        # Averaged over where in its pixel an outline may lie: T/3 + B/6. Real pixels that mix too, under a
        # mask that is true above one half, give 3T/8 + B/8; the simulated camera, with one sample in each,
        # T/2, as would c T here. So the product is nearer to real cameras, and with the simulated one c T is
        # no better: mean errors of fits 0.17 mm, with c T 0.15 mm (board, 8 seeds), 0.41 and 0.40 (pancake,
        # 8), 0.77 and 0.77 (thread, 6), on each seed within 0.1 mm of each other.
        return self._compared(rendered, self._clear)

    def _compared(self, rendered: Rendered, clear: np.ndarray) -> torch.Tensor:
        image = rendered.color * rendered.target[..., None]
        return image * torch.from_numpy(clear)[..., None] if self.thin else image

    def image(self, values: np.ndarray, colors: np.ndarray) -> TargetImage:
        """The compared part for values (P,), without gradient."""
        return self.images(values[None], colors)[0]

    def images(self, values: np.ndarray, colors: np.ndarray) -> list[TargetImage]:
        """The same for values (B, P), in one rendering; depth is 0 far from the target."""
        with torch.no_grad():
            rendered = self.model.render_target(
                self._whole(torch.as_tensor(values)),
                torch.as_tensor(colors),
                self.camera,
                self._tool_arm,
                self._which,
            )
            color, depth, mask = self._shown(*rendered)
        shape = (self.camera.intrinsics.height, self.camera.intrinsics.width)
        whole = [rendered[1].pasted(part, *shape) for part in (color, depth, mask)]
        return [TargetImage(c, d, m, 0 if self.thin else 1) for c, d, m in zip(*whole, strict=True)]

    def _shown(self, r: Rendered, window: Window) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Colour (B, h, w, 3), depth [m] and mask (B, h, w) of the window."""
        clear = self._clear[window.rows, window.columns]
        color = self._compared(r, clear).numpy().astype(np.float64)
        if self.thin:  # the mean point would lie between the thread and what is behind it
            mask = self._thin_mask(r.target.numpy(), r.label.numpy(), clear)
            return color, r.depth.numpy().astype(np.float64), mask
        # Depth of the pixel's mean point: `Rendered.depth` is that of the nearest sample, which on a slanted
        # face is a quarter of a pixel too near and pushed the estimate away from the camera by 0.4 mm.
        world_in_camera = self.camera.camera_in_world.inverse()
        xyz = r.xyz.numpy().astype(np.float64)
        depth = xyz @ world_in_camera.rotation[2] + world_in_camera.position[2]
        return color, depth, r.target.numpy() > 0.5

    def cloud(self, rendered: Rendered) -> np.ndarray:
        """X_sim of eq. 5: the target's points (N, 3) in a rendered image, taken as from a real one [m]."""
        if self.thin:
            mask = self._thin_mask(rendered.target.detach().numpy(), rendered.label.numpy(), self._clear)
            depth = np.where(mask, rendered.depth.numpy().astype(np.float64), np.nan)
            return target_cloud(self.camera.unproject(depth), mask, 0)
        mask = rendered.target.detach().numpy() > 0.5
        return target_cloud(rendered.xyz.detach().numpy().astype(np.float64), mask)

    def compared_points(self, cloud: np.ndarray) -> np.ndarray:
        """Points (N, 3) as eq. 5 matches them: where they are, or where they are seen in the plane [m]."""
        if not self._plane:
            return cloud
        pose = self.camera.camera_in_world
        local = pose.inverse().apply(cloud)
        return pose.apply(local * (self._plane / np.maximum(local[:, 2:], 1e-3)))

    def compared_motion(self, motion: np.ndarray) -> np.ndarray:
        """Motion (N, 3, P) of such points: across the optical axis alone, where they are matched as seen."""
        if not self._plane:
            return motion
        return motion - self._axis[None, :, None] * np.einsum("c,ncp->np", self._axis, motion)[:, None]

    def _thin_mask(self, coverage: np.ndarray, label: np.ndarray, clear: np.ndarray) -> np.ndarray:
        """Half of a pixel's samples: as many pixels as a sensor with one sample in each would see."""
        return (coverage >= 0.5) & (label == self.label) & clear

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
        return self.part.groups

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
        """How many pixels of the target show each of its colour groups: the gradient of the summed image.

        (G,), zero for what is not the target's, though pixels that it covers in part show that, too.
        """
        variable = torch.tensor(colors, requires_grad=True)
        r = self.render(torch.as_tensor(values), variable)
        (gradient,) = torch.autograd.grad((r.color[..., 0] * r.target.detach()).sum(), variable)
        pixels = np.zeros(len(colors))
        pixels[self.target_groups] = gradient[self.target_groups, 0].numpy()
        return pixels

    def motion(self, values: np.ndarray, points: np.ndarray) -> np.ndarray:
        """How points (N, 3) of the target move with the parameters, (N, 3, P), fixed to their part."""
        frames = self.model.target_frames(self._whole_values(values), self._tool_arm, self._which)
        motion = frames.motion(points)
        return motion if self._others is None else motion[..., self.taken]

    def line(self, values: np.ndarray) -> np.ndarray:
        """Points (N, 3) along the middle of the target's chain, from the tool to the loose end [m]."""
        return self.model.target_frames(self._whole_values(values), self._tool_arm, self._which).points

    def thickness(self) -> float:
        """Radius of the target's chain [m].

        Raises:
            InputError: the target is no chain of capsules.
        """
        chain = self.model.task.scene(self.model.cell).tool.chain
        part = chain[-1].parts[0] if chain else None
        if not (self.part.is_chain and isinstance(part, Capsule)):
            raise InputError(f"task {self.model.task.name} has no thread of capsules; it has no thickness")
        return part.radius

    def visibility(self, values: np.ndarray, colors: np.ndarray) -> float:
        """Share of the target's surface turned to the camera that the image shows, 0..1.

        Evaluated at the faces' centres, by projected area; what lies outside the image or behind something,
        the target itself included, is not shown.
        """
        corners = self._surface(values)  # (F, 3, 3)
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])  # twice the area
        centre = corners.mean(axis=1)
        towards = self.camera.camera_in_world.position - centre
        distance = np.linalg.norm(towards, axis=1)
        area = np.maximum(np.einsum("fi,fi->f", normal, towards), 0.0) / distance**3
        if area.sum() <= 0.0:
            return 0.0
        u, v, depth = self.camera.project(centre).T
        k = self.camera.intrinsics
        framed = k.frames(u, v, depth)
        with torch.no_grad():
            visible_depth = self.render(torch.as_tensor(values), torch.as_tensor(colors)).depth.numpy()
        column = np.clip(u, 0, k.width - 1).astype(int)
        row = np.clip(v, 0, k.height - 1).astype(int)
        # A pixel's depth may be that of a neighbouring point of a slanted face: two pixels' worth of slack.
        shown = framed & (depth < visible_depth[row, column] + 0.003 + 2.0 * depth / k.fx)
        return min(1.0, float(area[shown].sum() / area.sum()))

    def whole_surface(self, values: np.ndarray) -> np.ndarray:
        """Corners of the target's triangles (N, 3) [m], for when none of it is in the model's image."""
        return np.unique(self._surface(values).reshape(-1, 3), axis=0)

    def _surface(self, values: np.ndarray) -> np.ndarray:
        return self.model.target_surface(self._whole_values(values), self._tool_arm, self._which)
