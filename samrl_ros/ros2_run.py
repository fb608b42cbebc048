"""`python -m samrl_ros.ros2_run NODE [--ros-args ...]`: one node in its own process, or the whole `cell`."""

from __future__ import annotations

import sys

from samrl_ros.contract.exit_codes import USAGE
from samrl_ros.hosting.ros_check import require_ros
from samrl_ros.hosting.threads import one_thread_per_library


def main() -> int:
    """Start the node named first; the rest of the command line is ROS's."""
    names = ("sim_bridge", "model_updater", "view_planner", "manipulator", "residual_trainer", "recorder")
    known = (*names, "supervisor", "cell")
    if len(sys.argv) < 2 or sys.argv[1] not in known:
        print(f"usage: python -m samrl_ros.ros2_run NODE [--ros-args ...]; NODE is one of {', '.join(known)}")
        return USAGE
    name, arguments = sys.argv[1], sys.argv[2:]
    if name == "cell":
        from samrl_ros.cli.cell import main as cell_main

        return cell_main(arguments)
    require_ros()
    one_thread_per_library()
    from samrl_ros.hosting import run_node
    from samrl_ros.hosting.host import run_one

    ros_arguments = [sys.argv[0], *arguments]
    if name == "sim_bridge":
        from samrl_ros.nodes.sim_bridge import SimBridge

        return run_one(SimBridge, ros_arguments)
    if name == "recorder":
        from samrl_ros.nodes.recorder_node import RecorderNode

        return run_one(RecorderNode, ros_arguments)
    from samrl_ros.nodes.registry import entry

    node = entry(name)
    return run_node(node.behaviour, node.settings, name, ros_arguments)


if __name__ == "__main__":
    sys.exit(main())
