"""The scene that the model knows, as the camera should see it: triangles in the camera's axes, rendered."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.types.image_recording import ImageRecording
from samrl_core.common.errors import InputError

# Every diagnosis loads this file, few look at images: torch is loaded where a scene is built, since it takes
# longer than a short log to diagnose.
if TYPE_CHECKING:
    import torch

    from samrl_core.model.rendering.renderer import Rendered
    from samrl_core.model.scene.settings import ModelSettings

STATIC, OBJECT, TOOL, LINK = 0, 1, 2, 3  # what carries a vertex
ABOUT_S = 0.01  # half the time over which velocities are taken


@dataclass(frozen=True, eq=False)
class FrameGeometry:
    """One frame's geometry."""

    time: float  # [s]
    camera: np.ndarray  # (4, 4) camera in world
    camera_rate: np.ndarray  # (6,) twist of the camera in its own axes, linear first [m/s, rad/s]
    camera_jacobian: np.ndarray  # (6, J) the same per unit of each joint
    tool_rate: np.ndarray  # (6,) twist of the tool's flange in world, about the world's origin
    tool_jacobian: np.ndarray  # (6, J) the same per unit of each joint
    tool_joints: np.ndarray  # (J,)
    flange: np.ndarray  # (4, 4) the tool arm's flange in world


class ImageScene:
    """Triangles of table, object, tool and tool arm, and one renderer for one lens."""

    def __init__(self, recording: ImageRecording, intrinsics: Intrinsics) -> None:
        """Build the scene of the recording's task in its cell, with the calibration that it states.

        Raises:
            InputError: an unknown task or cell, or a task whose target is no rigid body.
        """
        import torch

        from samrl_core.model.rendering.renderer import Renderer
        from samrl_core.model.scene.scene_mesh import build_scene_mesh
        from samrl_core.model.scene.settings import ModelSettings

        task = task_named(recording.task)
        cell = replace(
            cell_named(recording.cell),
            camera_in_flange=recording.camera_in_flange,
            camera_base_in_world=recording.camera_base_in_world,
            tool_base_in_world=recording.tool_base_in_world,
            intrinsics=intrinsics,
        )
        self.scene = scene = task.scene(cell)
        nominal = np.array([p.nominal for p in task.parameters()])
        bodies = task.body_poses(nominal)
        if scene.tool.chain or len(bodies) != 1:
            raise InputError(
                f"task {task.name} has no single rigid target; images are compared of tasks that have, as"
                " peg_insertion"
            )
        self.intrinsics, self.cell = intrinsics, cell
        settings = ModelSettings(threads=1)
        self.table_grey = float(np.mean(settings.table_color))  # as drawn, 1 is white
        self.mesh = mesh = build_scene_mesh(scene, cell, settings)
        self._renderer = Renderer(mesh.topology, intrinsics, threads=1)
        (self.body,) = bodies
        self.origin = bodies[self.body].position.copy()  # about which the object is turned and scaled
        self.target_label = next(b.label for b in scene.bodies if b.name == self.body)
        self.tool_label = scene.tool.label
        self._posed = [
            (mesh.fixed[p.frame] if p.frame in mesh.fixed else None, p.vertices) for p in mesh.pieces
        ]
        self._posed = [
            (bodies.get(p.frame, pose), v) for p, (pose, v) in zip(mesh.pieces, self._posed, strict=True)
        ]
        flange = cell.tool_arm.flange
        of = {self.body: OBJECT, flange: TOOL}
        kinds = [of.get(p.frame, STATIC if p.frame in mesh.fixed else LINK) for p in mesh.pieces]
        self.group = np.concatenate(
            [np.full(len(v), k) for k, (_, v) in zip(kinds, self._posed, strict=True)]
        )
        tip = scene.tool.tip_in_flange.position
        nearest = min(
            (k for k, p in enumerate(mesh.pieces) if kinds[k] == TOOL and p.frame == flange),
            key=lambda k: float(np.min(np.linalg.norm(mesh.pieces[k].vertices - tip, axis=1))),
        )
        which = np.concatenate([np.full(len(v), k) for k, (_, v) in enumerate(self._posed)])
        self.is_tip = which == nearest
        self._which = which
        self._arms = {
            "tool": ArmModel(cell.tool_arm, cell.tool_base_in_world, None),
            "camera": ArmModel(cell.camera_arm, cell.camera_base_in_world, None),
        }
        shares = np.stack([self.group == OBJECT, self.is_tip, np.zeros(len(which))], axis=1)
        self._shares = torch.from_numpy(shares.astype(np.float32))
        self._shade = self._shading(settings)

    def view(self, recording: ImageRecording, time: float) -> FrameGeometry:
        """Where camera and tool were, by the stamps as they stand."""
        camera_joints, tool_joints = (recording.joints_at(a, time) for a in ("camera", "tool"))
        before, after = (
            [recording.joints_at(a, time + s * ABOUT_S) for a in ("camera", "tool")] for s in (-1, 1)
        )
        rates = [(b - a) / (2.0 * ABOUT_S) for a, b in zip(before, after, strict=True)]
        arm, base = self._arms["camera"], self.cell.camera_base_in_world.matrix()
        camera = arm.flange_in_world(camera_joints).matrix() @ self.cell.camera_in_flange.matrix()
        flange = arm.flange_in_world(camera_joints).matrix()
        jacobian = arm.jacobian(camera_joints)
        linear, angular = base[:3, :3] @ jacobian[:3], base[:3, :3] @ jacobian[3:]
        linear = linear + np.cross(angular.T, camera[:3, 3] - flange[:3, 3]).T
        turn = camera[:3, :3].T
        own = np.concatenate([turn @ linear, turn @ angular])
        arm, base = self._arms["tool"], self.cell.tool_base_in_world.matrix()
        tool = arm.flange_in_world(tool_joints).matrix()
        jacobian = arm.jacobian(tool_joints)
        linear, angular = base[:3, :3] @ jacobian[:3], base[:3, :3] @ jacobian[3:]
        about_origin = np.concatenate([linear - np.cross(angular.T, tool[:3, 3]).T, angular])
        return FrameGeometry(
            time, camera, own @ rates[0], own, about_origin @ rates[1], about_origin, tool_joints, tool
        )

    def vertices(self, view: FrameGeometry, object_pose: np.ndarray) -> np.ndarray:
        """Vertices (V, 3) in the camera's axes, the object moved by a transform (4, 4) about its origin."""
        links = self._arms["tool"].link_poses_in_world(view.tool_joints)
        world = np.concatenate(
            [
                (pose if pose is not None else links[p.frame]).apply(v)
                for p, (pose, v) in zip(self.mesh.pieces, self._posed, strict=True)
            ]
        )
        moved = self.group == OBJECT
        world[moved] = (world[moved] - self.origin) @ object_pose[:3, :3].T + self.origin + object_pose[:3, 3]
        return (world - view.camera[:3, 3]) @ view.camera[:3, :3]

    def render(self, vertices: np.ndarray, shaded: bool = False) -> Rendered:
        """Shares of object and tip in `color`, or grey values; `xyz` in the camera's axes."""
        import torch

        with torch.no_grad():
            return self._render(torch.from_numpy(vertices), self._shade if shaded else self._shares)

    def find_brightest(self, group: int) -> np.ndarray:
        """The most of each colour (3,) that vertices of `OBJECT` or `STATIC` are expected to have."""
        return self._shade.numpy()[self.group == group].max(axis=0).astype(float)

    def lit_by(self, settings: ModelSettings) -> ImageScene:
        """The same scene in the light of other settings: colours of faces are drawn with it."""
        from samrl_core.model.scene.scene_mesh import build_scene_mesh

        other = copy(self)
        other.mesh = build_scene_mesh(self.scene, self.cell, settings)
        other._shade = other._shading(settings)
        return other

    def gradients(self, vertices: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Gradients (n, V, 3) of sums of the shares under weights (n, H, W, 3), by the vertices.

        All sums are of one image: it is rendered once, and only its adjoint is taken n times.
        """
        import torch

        at = torch.from_numpy(vertices.copy()).requires_grad_(True)
        color = self._render(at, self._shares).color
        out = np.empty((len(weights), *vertices.shape))
        for k, weight in enumerate(torch.from_numpy(weights)):
            (gradient,) = torch.autograd.grad(color, at, weight, retain_graph=True)
            out[k] = gradient.numpy()
        return out

    def _render(self, vertices: torch.Tensor, colors: torch.Tensor) -> Rendered:
        import torch

        zero = torch.zeros(len(self.group), dtype=torch.float32)
        eye, none = torch.eye(3, dtype=torch.float64), torch.zeros(3, dtype=torch.float64)
        return self._renderer(vertices, colors, zero, eye, none)

    def _shading(self, settings: ModelSettings) -> torch.Tensor:
        """CAD colours (V, 3) under the assumed light; those of moving parts as they stand at first."""
        import torch

        from samrl_core.model.scene.color_groups import lambert

        mesh = self.mesh
        normals = np.concatenate([p.normals for p in mesh.pieces])
        shade = lambert(normals, settings.ambient, np.array(settings.towards_light))
        rest = torch.from_numpy((mesh.fixed_color * shade[:, None]).astype(np.float32))
        return mesh.vertex_colors(torch.from_numpy(mesh.initial_colors.astype(np.float32)), rest)
