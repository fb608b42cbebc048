"""Kinematics and statics of the chain that hangs from a tool's tip."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import ChainLink
from samrl_core.common.errors import InputError


def link_frames(lengths: Sequence[float], tip: Pose, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frames of the links as plain arrays, for what asks for them many times.

    Args:
        lengths: of the K links [m].
        tip: of the tool, where the first link's joints are.
        angles: (2 K,) about x and y of each link in turn [rad], not checked.

    Returns:
        Rotations (K, 3, 3), and joints of the links and the end of the last (K + 1, 3) [m].
    """
    cosines, sines = np.cos(angles).reshape(-1, 2), np.sin(angles).reshape(-1, 2)
    turn, point = tip.rotation, tip.position
    turns, points = [], [point]
    for length, (cx, cy), (sx, sy) in zip(lengths, cosines, sines, strict=True):
        turn = turn @ np.array([[cy, 0.0, sy], [sx * sy, cx, -sx * cy], [-cx * sy, sx, cx * cy]])  # Rx Ry
        point = point + length * turn[:, 2]
        turns.append(turn)
        points.append(point)
    return np.array(turns).reshape(-1, 3, 3), np.array(points)


def link_poses(chain: Sequence[ChainLink], tip: Pose, angles: np.ndarray) -> tuple[Pose, ...]:
    """Poses of the links in the frame that `tip` is given in.

    Args:
        chain: K links.
        tip: of the tool, where the first link's joints are.
        angles: (2 K,) about x and y of each link in turn [rad].

    Raises:
        InputError: not two finite angles per link.
    """
    turns, points = link_frames([link.length for link in chain], tip, checked_angles(chain, angles))
    return tuple(Pose.from_rotation(point, turn) for point, turn in zip(points[:-1], turns, strict=True))


def joint_axes(tip: Pose, turns: np.ndarray) -> np.ndarray:
    """Axes (2 K, 3) of the joints about x and y of links turned by `turns` (K, 3, 3).

    About x a link turns against the one before, about y with its own axis.
    """
    before = np.concatenate([tip.rotation[None], turns[:-1]])[: len(turns)]
    return np.stack([before[:, :, 0], turns[:, :, 1]], axis=1).reshape(-1, 3)


def chain_points(chain: Sequence[ChainLink], poses: Sequence[Pose]) -> np.ndarray:
    """Joints of the links at `poses` and the end of the last, (K + 1, 3) [m]; (0, 3) without links."""
    if not chain:
        return np.zeros((0, 3))
    end = poses[-1].apply(np.array([0.0, 0.0, chain[-1].length]))
    return np.array([*(pose.position for pose in poses), end])


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
    turns, points = link_frames([link.length for link in chain], tip, checked_angles(chain, angles))
    axes = joint_axes(tip, turns)
    torque = np.zeros(2 * len(chain))
    force, moment = np.zeros(3), np.zeros(3)  # of what hangs below; its moment is about world's origin
    for i in reversed(range(len(chain))):
        weight = chain[i].mass * gravity
        force = force + weight
        moment = moment + np.cross(points[i] + turns[i] @ chain[i].center_of_mass, weight)
        about_joint = moment - np.cross(points[i], force)
        torque[2 * i : 2 * i + 2] = -axes[2 * i : 2 * i + 2] @ about_joint
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
