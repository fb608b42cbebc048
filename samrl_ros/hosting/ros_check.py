"""One clear error when ROS 2 is missing, half installed, or installed twice."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
from collections.abc import Mapping

from samrl_core.common.errors import SamrlError

WAYS = """Any one of these gives it one:
  1. pip install 'samrl[ros]' in a virtual environment without a sourced ROS 2 (Linux x86_64);
  2. source /opt/ros/jazzy/setup.bash and use a Python 3.12 environment with --system-site-packages,
     samrl installed there *without* the ros extra, interfaces built by colcon;
  3. after uv sync, which removes files of the ROS wheels on its second run: uv sync --reinstall --extra ros,
     and from then on uv sync --inexact."""


class RosMissingError(SamrlError):
    """This environment cannot run ROS nodes; the message says what to do."""


def require_ros() -> None:
    """Return when nodes can run here. Raises RosMissingError, naming the cause and three ways out."""
    wheels = _version("ros-rclpy")
    clash = ros_clash(wheels, os.environ)
    if clash:
        raise RosMissingError(clash)
    if importlib.util.find_spec("rclpy") is None:
        if wheels is None:
            raise RosMissingError(f"This Python environment has no ROS 2 (no module rclpy). {WAYS}")
        raise RosMissingError(
            f"ros-rclpy {wheels} is installed, but the files of rclpy are gone: a second exact uv sync does "
            f"that. {WAYS}"
        )
    try:
        import rclpy.node  # noqa: F401 (loads the shared libraries)
    except ImportError as error:
        raise RosMissingError(f"rclpy cannot be loaded: {error}. {WAYS}") from error
    for package in ("samrl_msgs", "tf2_msgs"):
        spec = importlib.util.find_spec(package)
        if spec is None or spec.origin is None:
            raise RosMissingError(
                f"The interfaces {package} are not built. Run: python -m samrl_ros.interfaces.build "
                "(with a system ROS 2: colcon build --base-paths msgs_docs/samrl_msgs, then source it)."
            )


def ros_clash(wheels: str | None, environment: Mapping[str, str]) -> str:
    """Text when the ROS wheels meet a sourced system ROS, whose libraries mix; empty when all is well."""
    distribution = environment.get("ROS_DISTRO", "")
    if wheels is None or not distribution:
        return ""
    return (
        f"ROS 2 {distribution} is sourced in this shell, and the ROS wheels (ros-rclpy {wheels}) are "
        "installed in this environment: their libraries mix and crash. Use a shell without the sourced "
        "ROS 2, or an environment without the ros extra."
    )


def _version(distribution: str) -> str | None:
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return None
