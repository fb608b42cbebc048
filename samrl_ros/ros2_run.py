"""`python -m samrl_ros.ros2_run NODE... [--ros-args ...]`: nodes in one process, or the whole `cell`."""

import sys

from samrl_ros.contract.exit_codes import INPUT_REFUSED, OK, USAGE
from samrl_ros.contract.quiet_end import leave_quietly

ROS_ARGUMENTS, END_OF_ROS_ARGUMENTS = "--ros-args", "--"
HELP = {"-h", "--help"}


def run(given: list[str]) -> int:
    """Start the nodes named first; of the rest, what follows `--ros-args` is ROS's."""
    if given[:1] == ["cell"]:
        from samrl_ros.cli.cell.run import main as cell_main

        return cell_main(given[1:])
    count = next((k for k, argument in enumerate(given) if argument.startswith("-")), len(given))
    names, arguments = given[:count], given[count:]
    own = own_arguments(arguments)
    if not names and HELP & set(own):
        print(usage())
        return OK
    from samrl_core.common.errors import SamrlError

    try:
        from samrl_ros.hosting.ros_check import require_ros
        from samrl_ros.nodes.registry import EXECUTABLES

        require_ros()
    except SamrlError as error:
        print(f"error: {error}", file=sys.stderr)
        return INPUT_REFUSED
    unknown = [name for name in names if name not in EXECUTABLES]
    if unknown or not names:
        why = f"no node {unknown[0]!r}" if unknown else "which node?"
        print(f"{why}\n{usage()}", file=sys.stderr)
        return USAGE
    if HELP & set(own):
        from samrl_ros.nodes.node_help import node_help

        print(node_help(names))
        return OK
    if own:
        print(
            f"unknown argument {own[0]!r}; parameters follow {ROS_ARGUMENTS}, as in"
            f" `{ROS_ARGUMENTS} -p NAME:=VALUE`; --help lists them",
            file=sys.stderr,
        )
        return USAGE
    from functools import partial

    from samrl_ros.hosting.host import run_process
    from samrl_ros.hosting.threads import FreedMemory, one_thread_per_library
    from samrl_ros.nodes.registry import make_node

    one_thread_per_library()
    memory = FreedMemory()
    try:
        return run_process([partial(make_node, name) for name in names], [sys.argv[0], *arguments])
    finally:
        memory.stop()


def own_arguments(arguments: list[str]) -> list[str]:
    """Those that are not ROS's: outside of `--ros-args ... [--]`."""
    own, of_ros = [], False
    for argument in arguments:
        if argument == ROS_ARGUMENTS:
            of_ros = True
        elif of_ros:
            of_ros = argument != END_OF_ROS_ARGUMENTS
        else:
            own.append(argument)
    return own


def usage() -> str:
    """How to call it."""
    from samrl_ros.nodes.registry import EXECUTABLES

    return (
        "usage: python -m samrl_ros.ros2_run NODE... [--help] [--ros-args ...]\n"
        f"NODE is one of {', '.join((*EXECUTABLES, 'cell'))}"
    )


def main() -> None:
    """Entry point of the executables under lib/samrl_ros."""
    leave_quietly()
    from samrl_ros.contract.interrupts import leave

    leave(run(sys.argv[1:]))


if __name__ == "__main__":
    main()
