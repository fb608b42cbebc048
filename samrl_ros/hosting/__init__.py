"""Hosts for behaviours: lifecycle, parameters, diagnostics, executors. Needs ROS."""

from samrl_ros.hosting.ros_check import require_ros

require_ros()

from samrl_ros.hosting.behaviour_node import BehaviourNode  # noqa: E402 (after the check)
from samrl_ros.hosting.cell_node import CellNode  # noqa: E402
from samrl_ros.hosting.host import NodeThread, run_node, run_nodes, start_ros, stop_ros  # noqa: E402

__all__ = ["BehaviourNode", "CellNode", "NodeThread", "run_node", "run_nodes", "start_ros", "stop_ros"]
