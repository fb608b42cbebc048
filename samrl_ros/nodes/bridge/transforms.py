"""The tf tree of the cell: arm links from measured joints, mounts as static frames."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import TransformStamped

from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.robots.robot import ROLES, CellSpec
from samrl_core.cell.types.pose import Pose
from samrl_ros.conversions import to_message

OPTICAL_FRAME = "camera_color_optical_frame"
# REP-103: body axes x forward, y left, z up, seen from the optical frame (z forward, x right, y down).
CAMERA_LINK_IN_OPTICAL = Pose.from_rotation(np.zeros(3), np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]]))


def static_transforms(cell: CellSpec, tip_in_flange: Pose, stamp_ns: int) -> list[TransformStamped]:
    """Bases in world, camera and tool on their flanges."""
    return [
        *(
            to_message.transform(stamp_ns, "world", cell.arm(role).base_link, cell.base_in_world(role))
            for role in ROLES
        ),
        to_message.transform(stamp_ns, cell.camera_arm.flange, OPTICAL_FRAME, cell.camera_in_flange),
        to_message.transform(stamp_ns, OPTICAL_FRAME, "camera_link", CAMERA_LINK_IN_OPTICAL),
        to_message.transform(stamp_ns, cell.tool_arm.flange, "tool_tip", tip_in_flange),
    ]


def dynamic_transforms(
    arms: dict[str, ArmModel], positions: dict[str, np.ndarray], stamp_ns: int
) -> list[TransformStamped]:
    """Every link in its parent link, from joint positions (J,) [rad]."""
    transforms = []
    for role, arm in arms.items():
        links = list(arm.link_poses_in_world(positions[role]).items())  # base first, a serial chain
        for (parent, parent_in_world), (child, child_in_world) in zip(links, links[1:], strict=False):
            child_in_parent = parent_in_world.inverse() @ child_in_world
            transforms.append(to_message.transform(stamp_ns, parent, child, child_in_parent))
    return transforms
