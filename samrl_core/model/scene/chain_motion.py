"""Poses of the links of the tool's chain, as tensors with their Jacobian by the task's parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch

from samrl_core.cell.tasks.chain import checked_angles, joint_axes, link_frames
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import ChainLink
from samrl_core.model.scene.body_motion import TensorPose, central_differences, checked_values, first_order


class ChainMotion:
    """Forward kinematics of K links below a tool tip that is known, e.g. from measured joints.

    Where the parameters stretch the chain, the links' z axes are as long as the stretch.

    Joint angles follow from the parameters by `Task.chain_angles`, whose Jacobian is taken by central
    differences; from the angles on it is that of the kinematics (a joint turns all links below it
    about its axis).
    """

    def __init__(self, task: Task, chain: Sequence[ChainLink]) -> None:
        """Remembers the chain's lengths."""
        self._task = task
        self._chain = tuple(chain)
        self._scale = np.array([p.scale for p in task.parameters()])

    def __call__(self, values: torch.Tensor, tip_in_world: Pose) -> TensorPose:
        """Rotations (K, 3, 3) and joints (K, 3) [m] of the links in world, exact in value, first order in
        gradient.

        Raises:
            InputError: wrong shape or a non-finite value.
        """
        here = checked_values(values, len(self._scale))
        rows = first_order(self.rows(here, tip_in_world), lambda: self.jacobians(here, tip_in_world), values)
        return TensorPose(rows[:, :9].reshape(-1, 3, 3), rows[:, 9:])

    def rows(self, values: np.ndarray, tip_in_world: Pose) -> np.ndarray:
        """Rotation by rows and position of each link's frame, (K, 12), at values (P,)."""
        turns, positions = self._frames(values, tip_in_world)
        return np.concatenate([turns.reshape(-1, 9), positions], axis=1)

    def jacobians(self, values: np.ndarray, tip_in_world: Pose) -> np.ndarray:
        """How `rows` change with the values, (K, 12, P)."""
        turns, positions = self._frames(values, tip_in_world)
        axes = joint_axes(tip_in_world, turns)
        count = len(self._chain)
        joint = np.repeat(np.arange(count), 2)  # link that carries each axis
        below = (np.arange(count)[:, None] >= joint).astype(np.float64)  # (K, 2K)
        # Axis x column of the rotation, and axis x lever.
        turning = np.cross(axes[None, :, None], np.swapaxes(turns, 1, 2)[:, None])  # (K, 2K, column, row)
        moving = np.cross(axes[None], positions[:, None] - positions[joint][None])  # (K, 2K, 3)
        rows = np.concatenate([np.swapaxes(turning, 2, 3).reshape(count, -1, 9), moving], axis=2)
        by_angle = rows * below[..., None]
        angle_jacobian = central_differences(self._task.chain_angles, values, self._scale)  # (2K, P)
        by_values = np.einsum("kac,ap->kcp", by_angle, angle_jacobian)
        stretch_jacobian = central_differences(self._stretch, values, self._scale)  # (1, P)
        if not stretch_jacobian.any():
            return by_values
        longer = np.zeros((count, 12))
        longer[:, [2, 5, 8]] = turns[:, :, 2]
        longer[:, 9:] = positions - positions[0]
        return by_values + longer[:, :, None] * stretch_jacobian / self._stretch(values)

    def _stretch(self, values: np.ndarray) -> np.ndarray:
        return np.array([self._task.chain_stretch(values)])

    def _frames(self, values: np.ndarray, tip: Pose) -> tuple[np.ndarray, np.ndarray]:
        """Rotations (K, 3, 3) and joints (K, 3) [m]."""
        angles = checked_angles(self._chain, self._task.chain_angles(values))
        stretch = self._task.chain_stretch(values)
        turns, points = link_frames([stretch * link.length for link in self._chain], tip, angles)
        return (turns if stretch == 1.0 else turns * [1.0, 1.0, stretch]), points[:-1]
