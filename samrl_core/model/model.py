"""The model of the cell: renders what the camera should see (eq. 2) and predicts what moves (eq. 3).

Built from nominal knowledge alone: the task's scene, the arms' shapes and calibration. What the task
declares unknown (`Task.parameters`) and the colours of its bodies come with every call.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.camera import Camera
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError
from samrl_core.model.rendering.renderer import Rendered, Renderer
from samrl_core.model.rendering.window import Window, whole_image, window_around
from samrl_core.model.scene.body_motion import BodyMotion, central_differences, first_order
from samrl_core.model.scene.chain_motion import ChainMotion
from samrl_core.model.scene.chain_skin import CHAIN
from samrl_core.model.scene.color_groups import lambert
from samrl_core.model.scene.scene_mesh import SceneMesh, build_scene_mesh
from samrl_core.model.scene.settings import ModelSettings
from samrl_core.model.scene.target import ALONG, Reach, TargetFrames, TargetPart
from samrl_core.model.scene.target_parts import target_parts
from samrl_core.model.task_dynamics.choose import dynamics_of
from samrl_core.model.task_dynamics.settings import ContactSettings, TaskPhysicsSettings
from samrl_core.model.task_dynamics.task_dynamics import TaskDynamics, TaskState

CameraPose = tuple[torch.Tensor, torch.Tensor]  # rotation (3, 3) and translation (3,), world to camera
CACHED_SIZES = 4  # of parts of other sizes than drawn, whose dynamics are kept: some 10 MB each


class Model:
    """Renderer and forward model of one task in one cell.

    Bodies move with the task's parameters, and so do the links of the chain that hangs from the tool's
    tip: together they are the target. Tip, tool and tool arm, which may hide the target, stand where the
    measured joints give. The camera arm is not rendered: its camera points away from it.
    """

    def __init__(self, task: Task, cell: CellSpec, settings: ModelSettings | None = None) -> None:
        """Builds meshes, colour groups and the renderer.

        Raises:
            InputError: the parameters move a body that does not exist, or nothing, or things whose labels
                differ.
        """
        self.task = task
        self.cell = cell
        self.settings = s = settings or ModelSettings()
        self._scene = task.scene(cell)
        self._motion = BodyMotion(task)
        nominal = torch.tensor([p.nominal for p in task.parameters()], dtype=torch.float64)
        moved = list(self._motion(nominal))
        labels = {b.name: b.label for b in self._scene.bodies} | {CHAIN: 0}
        chain = self._scene.tool.chain
        if not set(moved) <= set(labels) - {CHAIN} or not (moved or chain):
            raise InputError(
                f"task {task.name} moves bodies {moved}, its scene has {sorted(set(labels) - {CHAIN})} and a "
                f"chain of {len(chain)} links; something there must move"
            )
        self._links = ChainMotion(task, chain) if chain else None
        self._mesh = build_scene_mesh(self._scene, cell, s)
        if self._mesh.skin is not None:
            moved.append(CHAIN)
            labels[CHAIN] = self._mesh.skin.label
        self._moved = frozenset(moved)
        self._arm = ArmModel(cell.tool_arm, cell.tool_base_in_world, None)
        self._renderer = Renderer(
            self._mesh.topology, cell.intrinsics, s.supersample, s.device, s.near, s.background, s.threads
        )
        self._parts = target_parts(task, self._mesh, {name: labels[name] for name in moved}, self._motion)
        self._camera_moves = np.array([p.kind == "camera" for p in task.parameters()])
        self._posed: _Occluders | None = None
        self._dynamics: TaskDynamics | None = None
        self._dynamics_of: dict[Task, TaskDynamics] = {}  # of parts of other sizes than drawn

    @property
    def mesh(self) -> SceneMesh:
        """All that is rendered, piece by piece, and the frames that carry the pieces."""
        return self._mesh

    @property
    def target(self) -> torch.Tensor:
        """1 on the vertices of the target's first part, else 0, (V,) float32."""
        return self._parts[0].vertices

    @property
    def parts(self) -> tuple[TargetPart, ...]:
        """The target by labels; the first is the one that networks are shown."""
        return self._parts

    @property
    def color_names(self) -> tuple[str, ...]:
        """Names of the colour groups, `<body>/<direction>`."""
        return self._mesh.color_names

    @property
    def target_label(self) -> int:
        """Segmentation label of the target's first part."""
        return self._parts[0].label

    @property
    def target_groups(self) -> np.ndarray:
        """Which colour groups are those of the target's first part, (K,) into `color_names`."""
        return self._parts[0].groups

    def initial_colors(self) -> np.ndarray:
        """CAD colours under the assumed light, (G, 3) linear RGB."""
        return self._mesh.initial_colors.copy()

    def tip_in_base(self, joints: np.ndarray) -> Pose:
        """Pose of the tool tip in the tool arm's base frame, from joint positions (J,) [rad]."""
        flange_in_world = self._arm.link_poses_in_world(joints)[self.cell.tool_arm.flange]
        return self.cell.tool_base_in_world.inverse() @ flange_in_world @ self._scene.tool.tip_in_flange

    def target_surface(self, values: np.ndarray, tool_arm_position: np.ndarray, part: int = 0) -> np.ndarray:
        """Corners of the target's triangles in world, (F, 3, 3) [m], wound outwards.

        Args:
            values: (P,).
            tool_arm_position: joint positions (J,) [rad].
            part: which of `parts`.
        """
        with torch.no_grad():
            vertices = self._vertices(torch.as_tensor(values), tool_arm_position).numpy()
        return vertices[self._parts[part].faces]

    def target_frames(self, values: np.ndarray, tool_arm_position: np.ndarray, part: int = 0) -> TargetFrames:
        """Frames that what one label shows is fixed to, and how they move with the values.

        Args:
            values: (P,).
            tool_arm_position: joint positions (J,) [rad].
            part: which of `parts`.
        """
        values = np.asarray(values, dtype=np.float64)
        used = self._parts[part]
        bodies = {name: rows for name, rows in self._motion.rows(values).items() if name in used.frames}
        jacobians = [rows for name, rows in self._motion.jacobians(values).items() if name in bodies]
        rows = list(bodies.values())
        points = [p.vertices for name in bodies for p in self._mesh.pieces if p.frame == name]
        if self._links is not None and used.is_chain:
            tip = self._occluders(tool_arm_position).tip
            rows += list(self._links.rows(values, tip))
            jacobians += list(self._links.jacobians(values, tip))
            points += [np.outer(ALONG * link.length, [0.0, 0.0, 1.0]) for link in self._scene.tool.chain]
        which = np.repeat(np.arange(len(points)), [len(p) for p in points])
        rows, jacobians = np.array(rows), np.array(jacobians)
        if self._camera_moves.any():
            rows[:, 9:] += self.task.camera_shift(values)
            jacobians[:, 9:] += self._shift_jacobian(values)
        stretched = self.task.chain_stretch(values) != 1.0 or bool(self.task.body_scales(values))
        return TargetFrames(rows, jacobians, np.concatenate(points), which, stretched)

    def chain_reach(self, tool_arm_position: np.ndarray) -> Reach | None:
        """Where the chain can be with the tool arm at a joint position (J,) [rad]; None for a rigid tool."""
        chain = self._scene.tool.chain
        if not chain:
            return None
        center = self._occluders(tool_arm_position).tip.position
        # Its thickness, and what the camera shows beside its place, are within the tenth.
        longest = self.task.chain_stretch(np.array([p.upper for p in self.task.parameters()]))
        return Reach(center, 1.1 * longest * sum(link.length for link in chain))

    def render(
        self,
        values: torch.Tensor,
        colors: torch.Tensor,
        camera: Camera | CameraPose,
        tool_arm_position: np.ndarray,
        part: int = 0,
    ) -> Rendered:
        """The image that the camera should take; differentiable in values, colours and camera tensors.

        Args:
            values: (P,) in the order of `Task.parameters`; (B, P) gives B images in one go.
            colors: (G, 3) linear RGB in the order of `color_names`.
            camera: a camera, or world-to-camera rotation and translation as tensors.
            tool_arm_position: joint positions (J,) [rad].
            part: which of `parts` is the target in the result.

        Raises:
            InputError: wrong shapes, non-finite values, or a camera with other intrinsics than the cell's.
        """
        return self._render(values, colors, camera, tool_arm_position, part, False)[0]

    def render_target(
        self,
        values: torch.Tensor,
        colors: torch.Tensor,
        camera: Camera,
        tool_arm_position: np.ndarray,
        part: int = 0,
    ) -> tuple[Rendered, Window]:
        """Of the same image the part that shows what the parameters move, and which part that is.

        Arguments and errors as of `render`; of (B, P) values all images have one window. Outside of it the
        target is not visible. A fit that asks for hundreds of images needs no more.
        """
        return self._render(values, colors, camera, tool_arm_position, part, True)

    def _render(
        self,
        values: torch.Tensor,
        colors: torch.Tensor,
        camera: Camera | CameraPose,
        tool_arm_position: np.ndarray,
        part: int,
        target_only: bool,
    ) -> tuple[Rendered, Window]:
        if tuple(colors.shape) != (len(self.color_names), 3):
            raise InputError(f"colors have shape {tuple(colors.shape)}, must be ({len(self.color_names)}, 3)")
        if isinstance(camera, Camera):
            if camera.intrinsics != self.cell.intrinsics:
                raise InputError(f"camera has {camera.intrinsics}, the cell's is {self.cell.intrinsics}")
            rotation, translation = world_to_camera(camera.camera_in_world)
        else:
            rotation, translation = camera
        if values.ndim == 2:
            vertices = torch.stack([self._vertices(v, tool_arm_position) for v in values])
        else:
            vertices = self._vertices(values, tool_arm_position)
        color = self._mesh.vertex_colors(
            colors.to("cpu", torch.float32), self._occluders(tool_arm_position).color
        )
        window, renderer = whole_image(self.cell.intrinsics), self._renderer
        target = self._parts[part].vertices
        if target_only:
            moved = vertices.detach()[..., target > 0, :].reshape(-1, 3) @ rotation.T + translation
            window = window_around(moved.numpy(), self.cell.intrinsics, self.settings.near)
            renderer = renderer.cut(window)
        return renderer(vertices, color, target, rotation, translation), window

    def dynamics_at(self, values: np.ndarray) -> TaskDynamics:
        """The dynamics of parts as large as the values (P,) have them; the sizes met last are kept.

        Raises:
            InputError: as of `dynamics`.
        """
        task = self.task.as_believed(values)
        if task is self.task or task == self.task:
            return self.dynamics
        found = self._dynamics_of.pop(task, None)
        if found is None:
            contact = ContactSettings(table_height=self.settings.table_height)
            found = dynamics_of(task, self.cell, TaskPhysicsSettings(contact=contact))
        self._dynamics_of[task] = found  # behind the others: the first is the one not asked for the longest
        if len(self._dynamics_of) > CACHED_SIZES:
            self._dynamics_of.pop(next(iter(self._dynamics_of)))
        return found

    @property
    def dynamics(self) -> TaskDynamics:
        """What the task's bodies do when the tip moves; its `start` makes states of an estimate.

        Raises:
            InputError: the task's scene has parts that no dynamics can move.
        """
        if self._dynamics is None:
            contact = ContactSettings(table_height=self.settings.table_height)
            self._dynamics = dynamics_of(self.task, self.cell, TaskPhysicsSettings(contact=contact))
        return self._dynamics

    def forward(self, state: TaskState, action: torch.Tensor) -> TaskState:
        """Eq. 3: the states after one displacement (B, 3) [m] each; see `TaskDynamics.forward`."""
        return self.dynamics.forward(state, action)

    def _vertices(self, values: torch.Tensor, tool_arm_position: np.ndarray) -> torch.Tensor:
        """World vertices (V, 3) [m], pieces in rendering order."""
        poses = self._motion(values)
        occluders = self._occluders(tool_arm_position)
        posed = dict(occluders.vertices)
        for k, piece in enumerate(self._mesh.pieces):
            if piece.frame == CHAIN and self._mesh.skin is not None and self._links is not None:
                posed[k] = self._mesh.skin.posed(self._links(values, occluders.tip))
            elif piece.frame in poses:
                pose = poses[piece.frame]
                posed[k] = piece.tensor @ pose.rotation.T + pose.position
        vertices = torch.cat([posed[k] for k in range(len(self._mesh.pieces))])
        if not self._camera_moves.any():
            return vertices
        here = values.detach().numpy()
        return vertices + first_order(
            self.task.camera_shift(here), lambda: self._shift_jacobian(here), values
        )

    def _shift_jacobian(self, values: np.ndarray) -> np.ndarray:
        """How the camera's shift changes with the values, (3, P)."""
        scale = np.array([p.scale for p in self.task.parameters()])
        return central_differences(self.task.camera_shift, values, scale)

    def _occluders(self, tool_arm_position: np.ndarray) -> _Occluders:
        """What the parameters do not move, posed by the joints; cached, as a fit asks for it many times."""
        joints = np.asarray(tool_arm_position, dtype=np.float64)
        if self._posed is not None and np.array_equal(self._posed.joints, joints):
            return self._posed
        links = self._arm.link_poses_in_world(joints)  # checks the joints
        vertices, normals = {}, []
        for k, piece in enumerate(self._mesh.pieces):
            if piece.frame in self._moved:
                normals.append(piece.normals)
                continue
            pose = links[piece.frame] if piece.frame in links else self._mesh.fixed[piece.frame]
            vertices[k] = torch.from_numpy(pose.apply(piece.vertices))
            normals.append(piece.normals @ pose.rotation.T)
        light = np.array(self.settings.towards_light)
        shade = lambert(np.concatenate(normals), self.settings.ambient, light)
        color = torch.from_numpy((self._mesh.fixed_color * shade[:, None]).astype(np.float32))
        tip = links[self.cell.tool_arm.flange] @ self._scene.tool.tip_in_flange
        self._posed = _Occluders(joints.copy(), tip, vertices, color)
        return self._posed


@dataclass(frozen=True, eq=False)
class _Occluders:
    joints: np.ndarray  # (J,) [rad]
    tip: Pose  # of the tool in world
    vertices: dict[int, torch.Tensor]  # per piece (V, 3) in world [m]
    color: torch.Tensor  # (V, 3) of all vertices; those with a colour group are not used


def world_to_camera(camera_in_world: Pose) -> CameraPose:
    """Rotation (3, 3) and translation (3,) that map world points into the camera, float64."""
    inverse = camera_in_world.inverse()
    return torch.from_numpy(inverse.rotation.copy()), torch.from_numpy(inverse.position.copy())
