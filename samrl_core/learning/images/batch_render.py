"""Many images of the model in one go, each of its own state, view and appearance; on a CPU or a GPU.

The arm's kinematics and the task's poses are in the frames that come with each state; here is one matrix
product per piece of the scene for all images together, then the renderer.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import torch

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.common.devices import numbered_device
from samrl_core.common.errors import InputError
from samrl_core.learning.images.appearance import Appearances, model_appearances
from samrl_core.learning.images.cell_errors import CellErrors
from samrl_core.learning.images.image_noise import ImageNoiseSettings, noisy
from samrl_core.learning.states.frames import SceneFrames
from samrl_core.model.model import CameraPose, Model
from samrl_core.model.rendering.renderer import Rendered, Renderer
from samrl_core.model.scene.body_motion import TensorPose
from samrl_core.model.scene.chain_skin import CHAIN
from samrl_core.policy.networks.network_image import network_image
from samrl_core.policy.networks.surface import nearest_points
from samrl_core.policy.view.views import cameras_of


@cache
def model_of(task: str, cell: str) -> Model:
    """The task's model in a cell, both by name."""
    return Model(task_named(task), cell_named(cell))


@cache
def renderer_of(task: str, cell: str, device: str) -> BatchRenderer:
    """It renders `model_of(task, cell)` on a device."""
    return BatchRenderer(model_of(task, cell), device)


@dataclass(frozen=True, eq=False)
class _Piece:
    """What is rendered as one."""

    frame: int  # into the frames; -1 where it stands still, -2 for the chain
    vertices: torch.Tensor  # (V, 3) in that frame, in world where it stands still [m]
    normals: torch.Tensor  # (V, 3) likewise; zero where a colour holds its shading


class BatchRenderer:
    """Renders states of one model; equal to `Model.render`, state by state."""

    def __init__(self, model: Model, device: str = "cpu", chunk: int = 128) -> None:
        """Copies the meshes to the device.

        Args:
            model: what is rendered.
            device: torch's name, e.g. "cpu" or "cuda:0".
            chunk: images at a time; what one takes is of the order of 2 MB.

        Raises:
            InputError: a chunk below 1.
        """
        if chunk < 1:
            raise InputError(f"chunk is {chunk} images, must be at least 1")
        self.model, self.device, self.chunk = model, numbered_device(device), chunk
        self.frame_names = SceneFrames(model).names
        mesh, s = model.mesh, model.settings
        self._skin = mesh.skin
        links = len(model.task.scene(model.cell).tool.chain)
        self._chain = slice(len(self.frame_names) - links, len(self.frame_names))
        self._pieces = []
        for piece in mesh.pieces:
            vertices, normals, frame = piece.vertices, piece.normals, -2
            if piece.frame in self.frame_names:
                frame = self.frame_names.index(piece.frame)
            elif piece.frame != CHAIN:
                pose = mesh.fixed[piece.frame]
                vertices, normals, frame = pose.apply(vertices), normals @ pose.rotation.T, -1
            self._pieces.append(_Piece(frame, self._tensor(vertices), self._tensor(normals)))
        colors, which = mesh.palette
        self._fixed, self._which = self._tensor(colors), torch.from_numpy(which).to(self.device)
        self._group = mesh.group.to(self.device)
        self._is_grouped = mesh.is_grouped.to(self.device)[:, None]
        self._target = model.target.to(self.device)
        lens = model.cell.intrinsics
        self._renderer = Renderer(
            mesh.topology, lens, s.supersample, str(self.device), s.near, s.background, s.threads
        )

    def render(
        self, frames: torch.Tensor | np.ndarray, camera: CameraPose, appearances: Appearances | None = None
    ) -> Rendered:
        """B images, all at once; differentiable in frames, camera and appearances.

        Args:
            frames: (B, F, 12) of `SceneFrames.rows`.
            camera: world-to-camera rotations (B, 3, 3) and translations (B, 3) [m].
            appearances: of B images; None takes the model's own.

        Raises:
            InputError: frames of another model, or another number of cameras or appearances.
        """
        rows = torch.as_tensor(frames).to(self.device, torch.float64)
        count, names = rows.shape[0], len(self.frame_names)
        appearances = appearances or model_appearances(self.model, count)
        if (
            rows.shape[1:] != (names, 12)
            or not len(camera[0]) == len(camera[1]) == len(appearances.colors) == count
        ):
            raise InputError(
                f"frames {tuple(rows.shape)}, cameras {len(camera[0])} and {len(camera[1])}, appearances "
                f"{len(appearances.colors)}: must be (B, {names}, 12) and B of the others"
            )
        appearances = appearances.to(self.device)
        poses = TensorPose(rows[..., :9].reshape(count, names, 3, 3), rows[..., 9:])
        vertices, cosines = [], []
        for piece in self._pieces:
            light = appearances.towards_light  # (B, 3)
            if piece.frame == -2:
                assert self._skin is not None
                links = TensorPose(poses.rotation[:, self._chain], poses.position[:, self._chain])
                vertices.append(self._skin.posed(links))
            elif piece.frame == -1:
                vertices.append(piece.vertices.expand(count, -1, -1))
            else:
                turn = poses.rotation[:, piece.frame]
                vertices.append(piece.vertices @ turn.mT + poses.position[:, piece.frame, None])
                light = (light[:, None] @ turn)[:, 0]  # in the piece's frame: R^T l
            cosines.append(light @ piece.normals.T)
        ambient = appearances.ambient[:, None]
        shade = ambient + (1.0 - ambient) * torch.cat(cosines, dim=1).clamp_min(0.0)  # Lambert 1760
        ungrouped = (self._fixed * appearances.gain)[:, self._which] * shade[..., None]
        color = torch.where(self._is_grouped, appearances.colors[:, self._group], ungrouped).clamp(0.0, 1.0)
        return self._renderer(torch.cat(vertices, dim=1), color, self._target, *camera)

    def images(
        self,
        frames: torch.Tensor | np.ndarray,
        tip_in_base: torch.Tensor | np.ndarray,
        views: np.ndarray,
        appearances: Appearances | None = None,
        noise: ImageNoiseSettings | None = None,
        generator: torch.Generator | None = None,
        errors: CellErrors | None = None,
    ) -> torch.Tensor:
        """Input of the networks, (B, 6, H, W) float32 on the renderer's device, without gradients.

        Args:
            frames: (B, F, 12).
            tip_in_base: (B, 3) tool tip in the tool arm's base frame [m].
            views: (B, 6) as `sample_views` gives them.
            appearances: of B images; None takes the model's own.
            noise: of the camera; None leaves it out.
            generator: of the noise, on the renderer's device.
            errors: by which the calibration of B cells is wrong; None leaves them out.

        Raises:
            InputError: as `render`, or noise without a generator.
        """
        if noise is not None and generator is None:
            raise InputError("noise needs a generator; hand in torch.Generator(device).manual_seed(seed)")
        rows, tips = torch.as_tensor(frames), torch.as_tensor(tip_in_base).to(self.device, torch.float64)
        base = self.model.cell.tool_base_in_world
        turn = self._tensor(base.rotation)
        tips = tips @ turn.T + self._tensor(base.position)
        parts = []
        for start in range(0, len(rows), self.chunk):
            few = slice(start, start + self.chunk)
            chosen = None if appearances is None else appearances.rows(few)
            rotation, translation = cameras_of(torch.as_tensor(views[few]).to(self.device, torch.float64))
            with torch.no_grad():
                r = self.render(rows[few], (rotation, translation), chosen)
                color, valid = r.color, torch.isfinite(r.depth)
                xyz = nearest_points(r, (rotation, translation), self.model.cell.intrinsics)
                if noise is not None and generator is not None:
                    eye = -(rotation.mT @ translation[..., None])[..., 0]
                    factor = None if chosen is None else chosen.noise
                    color, xyz, valid = noisy(color, xyz, r.depth, eye, generator, noise, factor)
                if errors is not None:
                    xyz = errors.rows(few).moved(xyz, (rotation, translation), self.model.cell)
                parts.append(network_image(color, xyz, valid, tips[few], base))
        return torch.cat(parts)

    def _tensor(self, array: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(np.array(array, dtype=np.float64)).to(self.device)
