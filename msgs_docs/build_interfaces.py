"""Build this folder's ROS interfaces into the active Python environment: see samrl_ros.interfaces.build."""

from __future__ import annotations

import sys
from pathlib import Path

# Replaces this folder, whose samrl_msgs would be importable as an empty namespace package.
sys.path[0] = str(Path(__file__).resolve().parents[1])

from samrl_ros.interfaces.build import main  # noqa: E402 (after the path is set)

if __name__ == "__main__":
    sys.exit(main())
