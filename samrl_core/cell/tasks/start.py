"""What every task needs at the start of an episode, and of whoever asks it."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.robots.inverse_kinematics import solve_ik
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.task import ViewRegion
from samrl_core.cell.types.pose import Pose, look_at
from samrl_core.cell.types.scene import Tool
from samrl_core.common.errors import InputError

DOWN = np.diag([1.0, -1.0, -1.0])  # the tool's orientation in every task: its z points at the table
DOWN.setflags(write=False)


def require_origin(cell: CellSpec, task: str) -> None:
    """Refuse a cell whose tool arm stands elsewhere: a task's numbers mean the same in both frames.

    Raises:
        InputError: the tool arm's base is not at the world's origin.
    """
    base = cell.tool_base_in_world
    if np.abs(base.position).max() > 1e-9 or base.angle_to(Pose.identity()) > 1e-9:
        raise InputError(
            f"tool arm's base stands at {base.position} in world; task {task} needs the world's origin "
            f"there, because its parameters and goals are given in both frames alike"
        )


def start_joints(cell: CellSpec, tool: Tool, tip: np.ndarray, camera: Pose) -> dict[str, np.ndarray]:
    """Joint positions (J,) [rad] per role.

    Args:
        cell: the two arms.
        tool: whose tip is put at `tip`, pointing down.
        tip: in the tool arm's base frame (3,) [m].
        camera: pose of the optical frame in world.

    Raises:
        ReachError: an arm does not get there.
    """
    tip_in_base = Pose.from_rotation(tip, DOWN)
    camera_in_base = cell.camera_base_in_world.inverse() @ camera
    flange_in_base = {
        "tool_arm": tip_in_base @ tool.tip_in_flange.inverse(),
        "camera_arm": camera_in_base @ cell.camera_in_flange.inverse(),
    }
    return {
        role: solve_ik(cell.arm(role), pose, cell.arm(role).home) for role, pose in flange_in_base.items()
    }


def middle_view(region: ViewRegion, azimuth: float) -> Pose:
    """Camera in world in the middle of a region's distances and elevations, at an azimuth [rad]."""
    distance, elevation = np.mean(region.distance), np.mean(region.elevation)
    direction = np.array(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    )
    return look_at(region.target + distance * direction, region.target)


def checked_tip(tip_position: np.ndarray) -> np.ndarray:
    """The tip (3,) [m] as float64.

    Raises:
        InputError: not three finite numbers.
    """
    tip = np.asarray(tip_position, dtype=np.float64)
    if tip.shape != (3,) or not np.isfinite(tip).all():
        raise InputError(f"tip position {tip_position} must be three finite numbers [m]")
    return tip
