"""Differentiable RGB-XYZ renderer: z-buffer with s x s samples, edge integral in the backward pass.

The image gradient of a pose lies almost wholly in the silhouettes. Soft rasterising would blur them
and antialiasing of pixel pairs misses thin parts, so the boundary integral is evaluated instead, along
every visible edge (see `edge_kernels`). There is no random number and no constant to tune.
Not covered: the curve where two bodies run through each other, and the near plane's own cut.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch

from samrl_core.errors import InputError
from samrl_core.model.autograd import Rasterize, make_setup
from samrl_core.model.raster_kernels import MAX_FACES, MIN_NEAR
from samrl_core.model.topology import Topology
from samrl_core.types.camera import Intrinsics
from samrl_core.types.scene import Rgb

_EDGE_STEP = 0.25  # [px] accuracy no longer improved below (measured against finite differences)


@dataclass(frozen=True, eq=False)
class Rendered:
    """One image of the model. Gradients flow through `color`, `xyz` and `target`.

    These three are means over the pixel, so a pixel on a silhouette mixes both sides. `depth` and
    `label` are those of the pixel's nearest sample.
    """

    color: torch.Tensor  # (H, W, 3) linear RGB
    xyz: torch.Tensor  # (H, W, 3) world position [m], 0 where nothing is seen
    target: torch.Tensor  # (H, W) share of the pixel in which the target body is seen, 0..1
    depth: torch.Tensor  # (H, W) along the optical axis [m], inf where nothing is seen
    label: torch.Tensor  # (H, W) int32 segmentation label, 0 where nothing is seen


class Renderer:
    """Draws one topology through one lens; vertices, colours and camera pose come with each call."""

    def __init__(
        self,
        topology: Topology,
        intrinsics: Intrinsics,
        supersample: int = 2,
        device: str = "cpu",
        near: float = 0.01,
        background: Rgb = (0.0, 0.0, 0.0),
    ) -> None:
        """Copies the topology to the device.

        Args:
            topology: triangles and edges.
            intrinsics: lens and image size.
            supersample: samples per pixel and direction.
            device: torch's name, e.g. "cpu" or "cuda:0".
            near: nothing nearer than this is drawn [m].
            background: linear RGB where nothing is seen.

        Raises:
            InputError: supersample, near plane or number of triangles out of range.
        """
        if not 1 <= supersample <= 64:
            raise InputError(f"supersample is {supersample}, must be 1..64")
        if not near >= MIN_NEAR:
            raise InputError(f"near plane at {near} m, must be at least {MIN_NEAR} m (depth resolution)")
        if len(topology.faces) > MAX_FACES:
            raise InputError(f"{len(topology.faces)} triangles, the z-buffer can tell {MAX_FACES} apart")
        self.topology = topology
        self.intrinsics = intrinsics
        self._device = torch.device(device)
        k = intrinsics
        self._setup = make_setup(
            torch.from_numpy(topology.faces),
            torch.from_numpy(topology.face_label),
            torch.from_numpy(topology.edges),
            (k.fx, k.fy, k.cx, k.cy, near),
            (k.width, k.height),
            supersample,
            _EDGE_STEP,
            background,
            device,
        )

    def __call__(
        self,
        vertices: torch.Tensor,
        color: torch.Tensor,
        target: torch.Tensor,
        camera_rotation: torch.Tensor,
        camera_translation: torch.Tensor,
    ) -> Rendered:
        """Render; gradients of doubled vertices land on either twin, so move twins together.

        Args:
            vertices: (V, 3) in world [m].
            color: (V, 3) linear RGB.
            target: (V,) 1 on the target body, else 0.
            camera_rotation: (3, 3) world to camera axes.
            camera_translation: (3,) world origin in the camera [m].

        Raises:
            InputError: a shape does not fit, or a value is not finite.
        """
        n = self.topology.n_vertices
        arguments = {
            "vertices": (vertices, (n, 3)),
            "color": (color, (n, 3)),
            "target": (target, (n,)),
            "camera_rotation": (camera_rotation, (3, 3)),
            "camera_translation": (camera_translation, (3,)),
        }
        for name, (value, shape) in arguments.items():
            if tuple(value.shape) != shape:
                raise InputError(f"{name} has shape {tuple(value.shape)}, the topology expects {shape}")
            if not bool(torch.isfinite(value).all()):
                raise InputError(f"{name} has a non-finite value; check the pose or colour it came from")
        world = vertices.to(self._device, torch.float64)
        rotation = camera_rotation.to(self._device, torch.float64)
        points = world @ rotation.T + camera_translation.to(self._device, torch.float64)
        attributes = torch.cat(
            [color.to(self._device), vertices.to(self._device), target.to(self._device)[:, None]], dim=1
        )
        image, depth, label = Rasterize.apply(
            points.to(torch.float32)[None], attributes.to(torch.float32)[None], self._setup
        )  # pyright: ignore[reportGeneralTypeIssues]
        image = image[0]
        return Rendered(image[..., 0:3], image[..., 3:6], image[..., 6], depth[0], label[0])
