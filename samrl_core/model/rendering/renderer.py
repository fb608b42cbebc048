"""Differentiable RGB-XYZ renderer: z-buffer with s x s samples, edge integral in the backward pass.

The image gradient of a pose lies almost wholly in the silhouettes. Soft rasterising would blur them
and antialiasing of pixel pairs misses thin parts, so the boundary integral is evaluated instead, along
every visible edge (see `edge_kernels`), and along the curves where parts run through each other or the
near plane cuts them (`cut_kernels`). There is no random number and no constant to tune.

Both sides of a surface are rendered: a camera inside a body sees its inside. Shadows and mirror images are
not rendered. Not covered: surfaces of one part that run through each other, and surfaces of two parts that
lie in each other (concentric ends of links). Where two parts cross, or the near plane cuts, the gradient's
error is of first order in the samples' spacing: some 5 % with 2 x 2 samples. Shared (smooth) normals
change steeply towards an outline of few pixels and need more samples than flat ones.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass

import torch

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.types.scene import Rgb
from samrl_core.common.devices import numbered_device
from samrl_core.common.errors import InputError
from samrl_core.model.rendering.autograd import Rasterize
from samrl_core.model.rendering.light import Light
from samrl_core.model.rendering.raster_kernels import MAX_FACES, MIN_NEAR
from samrl_core.model.rendering.raster_setup import make_setup
from samrl_core.model.rendering.topology import Topology
from samrl_core.model.rendering.window import Window

SUPERSAMPLE = 2  # samples per pixel and direction
_FAR = 1e6  # [m] single precision can no longer tell a centimetre there
_EDGE_STEP = 0.5  # [px] longest; steps end at pixel borders anyway (0.25 is no more accurate)


@dataclass(frozen=True, eq=False)
class Rendered:
    """One image of the model, or B of them. Gradients flow through `color`, `xyz` and `target`.

    These three are means over the pixel, so a pixel on a silhouette mixes both sides. `depth` and
    `label` are those of the pixel's nearest sample. With B in front of any argument, B is in front here.
    """

    color: torch.Tensor  # (H, W, 3) linear RGB
    xyz: torch.Tensor  # (H, W, 3) world position [m], 0 where nothing is visible
    target: torch.Tensor  # (H, W) share of the pixel in which the target body is visible, 0..1
    depth: torch.Tensor  # (H, W) along the optical axis [m], inf where nothing is visible
    label: torch.Tensor  # (H, W) int32 segmentation label (the mask), 0 where nothing is visible


class Renderer:
    """Draws one topology through one lens; vertices, colours, camera pose and light come with each call."""

    def __init__(
        self,
        topology: Topology,
        intrinsics: Intrinsics,
        supersample: int = SUPERSAMPLE,
        device: str = "cpu",
        near: float = 0.01,
        background: Rgb = (0.0, 0.0, 0.0),
        threads: int = 1,
    ) -> None:
        """Copies the topology to the device.

        Args:
            topology: triangles and edges.
            intrinsics: lens and image size.
            supersample: samples per pixel and direction.
            device: torch's name, e.g. "cpu" or "cuda:0".
            near: nothing nearer than this is rendered [m].
            background: linear RGB where nothing is visible.
            threads: at most so many share a batch on a CPU; the result is the same for any number.

        Raises:
            InputError: supersample, near plane, threads or number of triangles out of range.
        """
        if not 1 <= supersample <= 64:
            raise InputError(f"supersample is {supersample}, must be 1..64")
        if not MIN_NEAR <= near < _FAR:
            raise InputError(f"near plane at {near} m, must be {MIN_NEAR} m (depth resolution) to {_FAR} m")
        if len(topology.faces) > MAX_FACES:
            raise InputError(f"{len(topology.faces)} triangles, the z-buffer can distinguish {MAX_FACES}")
        if threads < 1:
            raise InputError(f"threads is {threads}, must be at least 1")
        self.topology = topology
        self.intrinsics = intrinsics
        self._device = numbered_device(device)
        self._setup = make_setup(
            topology, intrinsics, near, supersample, _EDGE_STEP, background, device, threads
        )

    def cut(self, window: Window) -> Renderer:
        """Draws only this part of the image: the same pixels, but for rounding, in a share of the time."""
        part = copy.copy(self)
        part.intrinsics = window.cut(self.intrinsics)
        part._setup = self._setup.seen_through(part.intrinsics)
        return part

    def __call__(
        self,
        vertices: torch.Tensor,
        color: torch.Tensor,
        target: torch.Tensor,
        camera_rotation: torch.Tensor,
        camera_translation: torch.Tensor,
        light: Light | None = None,
    ) -> Rendered:
        """Render; gradients of doubled vertices land on either twin, so move twins together.

        Every argument may have a batch of B in front, the same B for all that have one; the others are
        shared by all images, and get the sum of their gradients.

        Args:
            vertices: (V, 3) in world [m].
            color: (V, 3) linear RGB.
            target: (V,) 1 on the target body, else 0.
            camera_rotation: (3, 3) world to camera axes.
            camera_translation: (3,) world origin in the camera [m].
            light: Lambert shading of the colours; None takes them as they are.

        Raises:
            InputError: a shape does not fit, a value is not finite, a position is beyond 1e6 m, or the
                light is none.
        """
        n = self.topology.n_vertices
        arguments = {
            "vertices": (vertices, (n, 3), _FAR),
            "color": (color, (n, 3), torch.inf),
            "target": (target, (n,), torch.inf),
            "camera_rotation": (camera_rotation, (3, 3), torch.inf),
            "camera_translation": (camera_translation, (3,), _FAR),
        }
        batches = {} if light is None else {"light": light.batch}
        for name, (value, shape, limit) in arguments.items():
            batches[name] = tuple(value.shape[: value.dim() - len(shape)])
            if tuple(value.shape[len(batches[name]) :]) != shape or len(batches[name]) > 1:
                raise InputError(
                    f"{name} has shape {tuple(value.shape)}, the topology expects {shape} or (B, *{shape})"
                )
            if not bool((value.detach().abs() < limit).all()):
                raise InputError(
                    f"{name} has a non-finite value or one beyond {limit:g}; check where it came from"
                )
        found = {b for b in batches.values() if b}
        if len(found) > 1 or (0,) in found:
            raise InputError(f"batches {batches} differ or are empty; all must have one B, or none")
        batch = found.pop()[0] if found else 1
        world = vertices.to(self._device, torch.float64)
        rotation = camera_rotation.to(self._device, torch.float64)
        translation = camera_translation.to(self._device, torch.float64)
        points = world @ rotation.mT + translation.unsqueeze(-2)
        parts = (color, vertices, target.unsqueeze(-1))
        attributes = [p.to(self._device, torch.float32).expand(batch, n, p.shape[-1]) for p in parts]
        if light is None:
            rows = points.new_zeros((batch, 0), dtype=torch.float32)
        else:
            rows = light.rows(batch, self._device)
        image, depth, label = Rasterize.apply(
            points.to(torch.float32).expand(batch, n, 3), torch.cat(attributes, dim=2), rows, self._setup
        )
        if not any(batches.values()):
            image, depth, label = image[0], depth[0], label[0]
        return Rendered(image[..., 0:3], image[..., 3:6], image[..., 6], depth, label)
