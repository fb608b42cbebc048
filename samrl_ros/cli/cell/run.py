"""`samrl cell`, which is also `samrl-cell` and `ros2 run samrl_ros cell`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace

import typer

from samrl_ros.cell.run import CellOptions, run_cell


def run_with_node_arguments(options: CellOptions, context: typer.Context) -> int:
    """Run the cell; what followed `--ros-args` goes to its nodes."""
    return run_cell(replace(options, node_args=context.obj or ()))


def main(arguments: Sequence[str] | None = None) -> int:
    """`ros2 run samrl_ros cell [options] [--ros-args ...]`: the command `samrl cell`."""
    from samrl_ros.cli.main import run

    given = list(sys.argv[1:] if arguments is None else arguments)
    return run(["cell", *given])


if __name__ == "__main__":
    sys.exit(main())
