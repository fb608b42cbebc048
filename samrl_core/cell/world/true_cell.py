"""The cell and the scene as they really are: nominal ones with an instance's differences in them.

Made anew for each world, so that world and model share no object. Nothing here is read by what acts, learns
or estimates.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from samrl_core.cell.instance.cell_instance import CellInstance
from samrl_core.cell.instance.grip import Grip
from samrl_core.cell.instance.parts import Parts
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.pose import Pose, rotation_vector
from samrl_core.cell.types.scene import Body, Part, Scene, Tool

_LOADS = ("tool_arm", "camera_arm")  # order of the payloads in `ArmDifferences`


@dataclass(frozen=True, eq=False)
class TrueScene:
    """What a world builds, and what its bodies are to the task."""

    task: Task  # with parts as made; it lays the bodies
    scene: Scene
    target: frozenset[str]  # bodies whose pose the task estimates


def true_cell(cell: CellSpec, instance: CellInstance) -> CellSpec:
    """The cell with its true calibration; lens and loads are not part of it."""
    if instance.is_nominal:
        return cell
    c = instance.calibration
    return replace(
        cell,
        camera_base_in_world=_moved(
            cell.camera_base_in_world, c.camera_base_position, c.camera_base_rotation
        ),
        camera_in_flange=_moved(cell.camera_in_flange, c.hand_eye_position, c.hand_eye_rotation),
    )


def true_load(
    role: str, mass: float, center_of_mass: np.ndarray, instance: CellInstance
) -> tuple[float, np.ndarray]:
    """True mass [kg] and centre (3,) [m] of a payload that the controller is told of."""
    k = _LOADS.index(role)
    share, offset = instance.arms.payload_mass[k], instance.arms.payload_centre[k]
    return float(mass * (1.0 + share)), center_of_mass + offset


def true_scene(task: Task, cell: CellSpec, instance: CellInstance) -> TrueScene:
    """The scene as made, placed, held and painted.

    Raises:
        InputError: the differences are too large for the task, as a pancake that reaches into the lip.
    """
    target = frozenset(task.body_poses(np.array([p.nominal for p in task.parameters()])))
    if instance.is_nominal:
        return TrueScene(task, task.scene(cell), target)
    made = task.as_made(instance.parts)
    scene = made.scene(cell)
    bodies = tuple(_painted_body(body, body.name in target, instance) for body in scene.bodies)
    tool = _held_tool(scene.tool, instance.grip)
    return TrueScene(made, Scene(bodies, _painted_tool(tool, instance, bool(target))), target)


def true_pose(body: Body, nominal: Pose, is_target: bool, parts: Parts) -> Pose:
    """Where a body stands that is laid at `nominal`; one that moves lies as it is laid."""
    if body.mass > 0.0:
        return nominal
    if is_target:
        x, y = parts.tilt
        return _moved(nominal, np.zeros(3), np.array([x, y, parts.turn]))
    offset = np.array([*parts.place, 0.0])
    return Pose(nominal.position + offset, nominal.quat_xyzw) @ Pose.from_rpy(
        np.zeros(3), (0.0, 0.0, parts.place_turn)
    )


def _moved(pose: Pose, position: np.ndarray, rotation: np.ndarray) -> Pose:
    """A pose with an error in its parent's axes, turned about its own origin."""
    turned = rotation_vector(rotation) @ Pose(np.zeros(3), pose.quat_xyzw)
    return Pose(pose.position + position, turned.quat_xyzw)


def _held_tool(tool: Tool, grip: Grip) -> Tool:
    """What is held, moved about the grip; the gripper's own parts stay."""
    centre = Pose(tool.grip_in_flange.position, Pose.identity().quat_xyzw)
    slip = centre @ Pose(grip.position, rotation_vector(grip.rotation).quat_xyzw) @ centre.inverse()
    held = len(tool.parts) - tool.hand

    def moved(part: Part) -> Part:
        return replace(part, part_in_body=slip @ part.part_in_body)

    parts = (*(moved(part) for part in tool.parts[:held]), *tool.parts[held:])
    return replace(tool, parts=parts, tip_in_flange=slip @ tool.tip_in_flange)


def _painted_body(body: Body, is_target: bool, instance: CellInstance) -> Body:
    look = instance.look
    offset = look.target_colour if is_target else look.tool_colour
    paint = np.clip(body.mesh.face_color + offset, 0.0, 1.0)
    return replace(body, mesh=replace(body.mesh, face_color=paint))


def _painted_tool(tool: Tool, instance: CellInstance, target_is_body: bool) -> Tool:
    look = instance.look

    def painted(color: tuple[float, float, float], offset: np.ndarray) -> tuple[float, float, float]:
        r, g, b = np.clip(np.array(color) + offset, 0.0, 1.0).tolist()
        return r, g, b

    chain_offset = look.tool_colour if target_is_body else look.target_colour
    chain = tuple(replace(link, color=painted(link.color, chain_offset)) for link in tool.chain)
    return replace(tool, color=painted(tool.color, look.tool_colour), chain=chain)
