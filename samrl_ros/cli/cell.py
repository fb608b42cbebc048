"""`samrl-cell` and `ros2 run samrl_ros cell`: the command `samrl cell` as an executable of its own."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from samrl_ros.cli.main import run


def main(arguments: Sequence[str] | None = None) -> int:
    """`ros2 run samrl_ros cell [options] [--ros-args ...]`: the command `samrl cell`."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    return run(["cell", *given])


if __name__ == "__main__":
    sys.exit(main())
