"""Kinematics and statics of the chain that hangs from a tool's tip."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.errors import InputError
from samrl_core.types.pose import Pose
from samrl_core.types.scene import ChainLink


def link_poses(chain: Sequence[ChainLink], tip: Pose, angles: np.ndarray) -> tuple[Pose, ...]:
    """Poses of the links in the frame that `tip` is given in.

    Args:
        chain: K links.
        tip: of the tool, where the first link's joints are.
        angles: (2 K,) about x and y of each link in turn [rad].

    Raises:
        InputError: not two finite angles per link.
    """
    angles = checked_angles(chain, angles)
    poses = []
    joint = tip
    for link, (about_x, about_y) in zip(chain, angles.reshape(-1, 2), strict=True):
        (cx, sx), (cy, sy) = ((np.cos(a), np.sin(a)) for a in (about_x, about_y))
        turn = np.array([[cy, 0.0, sy], [sx * sy, cx, -sx * cy], [-cx * sy, sx, cx * cy]])  # Rx Ry
        pose = joint @ Pose.from_rotation(np.zeros(3), turn)
        poses.append(pose)
        joint = Pose(pose.apply(np.array([0.0, 0.0, link.length])), pose.quat_xyzw)
    return tuple(poses)


def chain_points(chain: Sequence[ChainLink], poses: Sequence[Pose]) -> np.ndarray:
    """Joints of the links at `poses` and the end of the last, (K + 1, 3) [m]; (0, 3) without links."""
    if not chain:
        return np.zeros((0, 3))
    end = poses[-1].apply(np.array([0.0, 0.0, chain[-1].length]))
    return np.array([*(pose.position for pose in poses), end])


def points_of_angles(lengths: Sequence[float], tip: Pose, angles: np.ndarray) -> np.ndarray:
    """As `chain_points` of `link_poses`, many times faster: (K + 1, 3) [m].

    Args:
        lengths: of the K links [m].
        tip: of the tool.
        angles: (2 K,) [rad].
    """
    cosines, sines = np.cos(angles), np.sin(angles)
    turn, point = tip.rotation, tip.position
    points = [point]
    for i, length in enumerate(lengths):
        (cx, cy), (sx, sy) = cosines[2 * i : 2 * i + 2], sines[2 * i : 2 * i + 2]
        turn = turn @ np.array([[cy, 0.0, sy], [sx * sy, cx, -sx * cy], [-cx * sy, sx, cx * cy]])  # Rx Ry
        point = point + length * turn[:, 2]
        points.append(point)
    return np.array(points)


def holding_torque(
    chain: Sequence[ChainLink], tip: Pose, angles: np.ndarray, gravity: np.ndarray
) -> np.ndarray:
    """Torque of each joint (2 K,) [N m] that holds the chain still against gravity.

    Args:
        chain: K links.
        tip: of the tool in world.
        angles: (2 K,) [rad].
        gravity: acceleration in world (3,) [m/s2].

    Raises:
        InputError: not two finite angles per link.
    """
    poses = link_poses(chain, tip, angles)
    torque = np.zeros(2 * len(chain))
    force, moment = np.zeros(3), np.zeros(3)  # of what hangs below; its moment is about world's origin
    for i in reversed(range(len(chain))):
        weight = chain[i].mass * gravity
        force = force + weight
        moment = moment + np.cross(poses[i].apply(chain[i].center_of_mass), weight)
        about_joint = moment - np.cross(poses[i].position, force)
        x_axis = (poses[i - 1] if i else tip).rotation[:, 0]  # of the link before, which it turns against
        y_axis = poses[i].rotation[:, 1]
        torque[2 * i : 2 * i + 2] = -x_axis @ about_joint, -y_axis @ about_joint
    return torque


def checked_angles(chain: Sequence[ChainLink], angles: np.ndarray) -> np.ndarray:
    """The angles as float64 (2 K,).

    Raises:
        InputError: not two finite numbers per link.
    """
    angles = np.asarray(angles, dtype=np.float64)
    if angles.shape != (2 * len(chain),) or not np.isfinite(angles).all():
        raise InputError(
            f"chain of {len(chain)} links needs {2 * len(chain)} finite angles [rad], got {angles}"
        )
    return angles
