"""What nodes that come late must know of a cell, whatever stands behind its bridge."""

from __future__ import annotations

from std_msgs.msg import String

from samrl_core.cell.robots.robot import ROLES, CellSpec
from samrl_core.cell.robots.urdf import description_of
from samrl_core.cell.types.scene import Tool
from samrl_ros.contract.behaviour import Outbox
from samrl_ros.contract.topics import arm_topic, camera_topic
from samrl_ros.conversions import to_message


def announce_cell(outbox: Outbox, cell: CellSpec, tool: Tool) -> None:
    """Publish the nominal arms, what each of them carries, and how the cell is calibrated."""
    for role in ROLES:
        outbox.publish(arm_topic(role, "robot_description"), String(data=description_of(cell.arm(role))))
    for role, payload in (
        ("tool_arm", (tool.mass, tool.center_of_mass, tool.inertia)),
        ("camera_arm", (cell.camera_mass, cell.camera_center_of_mass, cell.camera_inertia)),
    ):
        outbox.publish(arm_topic(role, "tool"), to_message.payload(*payload))
    outbox.publish(camera_topic("calibration"), to_message.calibration(cell))
