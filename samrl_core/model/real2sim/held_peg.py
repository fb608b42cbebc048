"""The held peg in an image: what its outline and depth say of where it truly is."""

from __future__ import annotations

import numpy as np
import torch

from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.types.camera import Camera
from samrl_core.cell.types.observation import Observation
from samrl_core.cell.types.scene import Cylinder, Tool
from samrl_core.common.errors import InputError
from samrl_core.model.model import world_to_camera
from samrl_core.model.real2sim.information import TargetImage
from samrl_core.model.rendering.renderer import Renderer
from samrl_core.model.rendering.topology import Topology
from samrl_core.model.scene.meshes import frustum_mesh

LENGTH = 0.026  # of the peg above its end that is compared; seen from above, fingers hide what is higher [m]
_WHOLE = 0.050  # that is rendered, so that no upper end shows [m]
_SEGMENTS = 32
_WHITE = (1.0, 1.0, 1.0)


class HeldPeg:
    """The lower end of a vertical peg, rendered as a white shape: outline and depth, no colour.

    Colour is left out because a peg a dozen pixels wide is half edge, where what stands behind counts too.

    Args:
        tool: one of its parts is a cylinder that ends at the tip.
        cell: its lens.

    Raises:
        InputError: there is no such part.
    """

    def __init__(self, tool: Tool, cell: CellSpec) -> None:
        self._label = tool.label
        self._radius = radius = _peg_radius(tool)
        mesh = frustum_mesh(radius, radius, _WHOLE, _WHITE, _SEGMENTS)
        count = len(mesh.vertices)
        # As wide as the circle on average, though its sides lie inside of it.
        across = 0.5 * (1.0 + 1.0 / np.cos(np.pi / _SEGMENTS))
        self._shape = mesh.vertices * [across, across, 1.0] + [0.0, 0.0, 0.5 * _WHOLE]
        topology = Topology.build(
            self._shape, mesh.faces, np.ones(count, np.int32), np.zeros(count, np.int32)
        )
        self._renderer = Renderer(topology, cell.intrinsics, background=(0.0, 0.0, 0.0))
        self._white = torch.ones((count, 3), dtype=torch.float32)
        self._target = torch.ones(count, dtype=torch.float32)

    def images(self, pegs: np.ndarray, camera: Camera, shown: np.ndarray) -> list[TargetImage]:
        """What the camera sees of pegs.

        Args:
            pegs: (B, 4) their ends in world, and how much wider and longer a mask has them [m].
            camera: whose image.
            shown: (H, W) bool, what is compared; see `compared_pixels`.
        """
        rotation, translation = world_to_camera(camera.camera_in_world)
        grown = 1.0 + pegs[:, None, 3:] / self._radius * [1.0, 1.0, 0.0]
        lower = pegs[:, None, 3] * (self._shape[:, 2] < 0.5 * _WHOLE)
        shapes = self._shape * grown + pegs[:, None, :3]
        shapes[..., 2] -= lower
        vertices = torch.from_numpy(shapes)
        with torch.no_grad():
            r = self._renderer(vertices, self._white, self._target, rotation, translation)
        coverage = r.target.numpy().astype(np.float64)  # (B, H, W)
        inverse = camera.camera_in_world.inverse()
        mean_point = r.xyz.numpy() / np.maximum(coverage, 1e-6)[..., None]  # of what is covered
        depth = mean_point @ inverse.rotation[2] + inverse.position[2]
        coverage = coverage * shown
        color = np.repeat(coverage[..., None], 3, axis=-1)
        return [TargetImage(c, d, m > 0.5) for c, d, m in zip(color, depth, coverage, strict=True)]

    def read(self, observation: Observation, shown: np.ndarray) -> TargetImage:
        """The same of a real image; `shown` as in `images`."""
        frame = observation.frame
        mask = (frame.mask == self._label) & shown
        color = np.repeat(mask[..., None].astype(np.float64), 3, axis=-1)
        return TargetImage(color, frame.depth.astype(np.float64), mask)


def compared_pixels(camera: Camera, tip: np.ndarray) -> np.ndarray:
    """Pixels (H, W) below a line across a peg believed at `tip` (3,) [m], `LENGTH` above its end."""
    low, high = camera.project(np.array([tip, tip + [0.0, 0.0, LENGTH]]))[:, :2]
    rows, columns = np.indices((camera.intrinsics.height, camera.intrinsics.width))
    pixels = np.stack([columns + 0.5, rows + 0.5], axis=-1)
    way = high - low
    return (pixels - low) @ way < float(way @ way)


def _peg_radius(tool: Tool) -> float:
    tip = tool.tip_in_flange.position
    for part in tool.parts:
        if isinstance(part, Cylinder):
            end = part.part_in_body.apply(np.array([0.0, 0.0, 0.5 * part.length]))
            if np.linalg.norm(end - tip) < 1e-6 and part.length > _WHOLE:
                return part.radius
    raise InputError(
        f"tool {tool.name} has no cylinder longer than {_WHOLE} m that ends at its tip; how it is held "
        f"cannot be seen"
    )
