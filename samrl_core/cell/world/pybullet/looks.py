"""How a cell that differs looks: meshes of its arms, things on its table, and what casts shadows there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pybullet

from samrl_core.cell.instance.cell_instance import CellInstance
from samrl_core.cell.robots.geometry import link_shapes
from samrl_core.cell.robots.robot import ROLES, CellSpec
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Box, Scene, Tool
from samrl_core.cell.world.clutter import lay_clutter
from samrl_core.cell.world.pybullet.arm import PyBulletArm
from samrl_core.cell.world.pybullet.arm_meshes import MeshVisual, mesh_visual
from samrl_core.cell.world.pybullet.bench import Caster
from samrl_core.cell.world.pybullet.body_files import GRIPPER_COLOR, PAYLOAD_LINK
from samrl_core.cell.world.pybullet.real_camera import look_stream

FAR_LINKS = 3  # the first so many links of an arm cast no shadow where the work is
LINK_FACES, HAND_FACES = 300, 700  # at most; the hand is what a camera sees most of an arm
PANEL_COLOR = (0.90, 0.90, 0.88)  # of an arm's mesh


def arm_meshes(
    cell: CellSpec,
    role: str,
    tool: Tool,
    folder: Path,
    link_faces: int = LINK_FACES,
    hand_faces: int = HAND_FACES,
) -> dict[str, list[MeshVisual]]:
    """Meshes by link of an arm and, where it holds the tool, of its hand; none that is not installed."""
    found: dict[str, list[MeshVisual]] = {}
    for link, uri in cell.arm(role).meshes.items():
        if (mesh := mesh_visual(uri, Pose.identity(), PANEL_COLOR, folder, link_faces)) is not None:
            found[link] = [mesh]
    if role == "tool_arm":
        hand = [mesh_visual(uri, pose, GRIPPER_COLOR, folder, hand_faces) for uri, pose in tool.meshes]
        shown = [mesh for mesh in hand if mesh is not None]
        if len(shown) == tool.hand == len(hand):  # all of the hand or nothing
            found[PAYLOAD_LINK] = shown
    return found


def build_clutter(client: int, instance: CellInstance, height: float = 0.0) -> list[Caster]:
    """Put the instance's things on the table, for cameras alone; returns them as casters of shadows.

    `height` is that of the table's top over the drawn one [m].
    """
    rng = look_stream(instance).spawn(1)[0]
    casters: list[Caster] = []
    for thing in lay_clutter(rng, round(0.6 * instance.look.clutter)):
        part = thing.part
        shape = (
            {"shapeType": pybullet.GEOM_BOX, "halfExtents": part.half_extents}
            if isinstance(part, Box)
            else {"shapeType": pybullet.GEOM_CYLINDER, "radius": part.radius, "length": part.length}
        )
        visual = pybullet.createVisualShape(**shape, rgbaColor=[*thing.color, 1.0], physicsClientId=client)
        pose = part.part_in_body
        place = (pose.position + [0.0, 0.0, height]).tolist()
        body = pybullet.createMultiBody(
            0.0, -1, visual, place, pose.quat_xyzw.tolist(), physicsClientId=client
        )
        casters.append((body, -1, replace(part, part_in_body=Pose.identity())))
    return casters


def casters_of(
    cell: CellSpec, arms: Mapping[str, PyBulletArm], scene: Scene, body_index: Mapping[str, int]
) -> tuple[list[Caster], list[Caster]]:
    """Coarse shapes of arms, tool and movable bodies, and those of fixed bodies."""
    casters: list[Caster] = []
    for role in ROLES:
        arm = arms[role]
        for link, parts in link_shapes(cell.arm(role)).items():
            if arm.link_index.get(link, -1) >= FAR_LINKS:
                casters += [(arm.body, arm.link_index[link], part) for part in parts]
    tool_arm, tool = arms["tool_arm"], scene.tool
    casters += [(tool_arm.body, tool_arm.payload_link, part) for part in tool.parts]
    casters += [
        (tool_arm.body, tool_arm.link_index[one.name], part) for one in tool.chain for part in one.parts
    ]
    fixed: list[Caster] = []
    for body in scene.bodies:
        (casters if body.mass > 0.0 else fixed).extend((body_index[body.name], -1, p) for p in body.parts)
    return casters, fixed
