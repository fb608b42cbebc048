"""`python -m samrl_ros.ros2_run NODE... [--ros-args ...]`: nodes in one process, or the whole `cell`."""

from __future__ import annotations

import sys
from functools import partial
from itertools import takewhile

from samrl_ros.contract.exit_codes import USAGE
from samrl_ros.hosting.ros_check import require_ros
from samrl_ros.hosting.threads import one_thread_per_library
from samrl_ros.nodes.registry import NODES, make_node


def main() -> int:
    """Start the nodes named first; the rest of the command line is ROS's."""
    given = sys.argv[1:]
    if given[:1] == ["cell"]:
        from samrl_ros.cli.cell import main as cell_main

        return cell_main(given[1:])
    names = list(takewhile(lambda argument: not argument.startswith("-"), given))
    if not names or not set(names) <= set(NODES):
        known = ", ".join((*NODES, "cell"))
        print(f"usage: python -m samrl_ros.ros2_run NODE... [--ros-args ...]; NODE is one of {known}")
        return USAGE
    require_ros()
    one_thread_per_library()
    from samrl_ros.hosting.host import run_process

    arguments = [sys.argv[0], *given[len(names) :]]
    return run_process([partial(make_node, name) for name in names], arguments)


if __name__ == "__main__":
    sys.exit(main())
