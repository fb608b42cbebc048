"""Poses of the links of the tool's chain, as tensors with their slope by the task's parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch

from samrl_core.errors import InputError
from samrl_core.model.body_motion import TensorPose
from samrl_core.tasks.chain import checked_angles
from samrl_core.tasks.task import Task
from samrl_core.types.pose import Pose
from samrl_core.types.scene import ChainLink

_STEP = 1e-4  # of a parameter's scale, as in `body_motion`


class ChainMotion:
    """Forward kinematics of K links below a tool tip that is known, e.g. from measured joints.

    Joint angles follow from the parameters by `Task.chain_angles`, whose slope is taken by central
    differences; from the angles on the slope is that of the kinematics (a joint turns all links below it
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
        if tuple(values.shape) != self._scale.shape:
            raise InputError(
                f"values have shape {tuple(values.shape)}, the task declares {self._scale.shape}"
            )
        here = values.detach().cpu().numpy().astype(np.float64)
        rows = torch.from_numpy(self.rows(here, tip_in_world))
        if values.requires_grad and torch.is_grad_enabled():
            moved = (values - values.detach()).to("cpu", torch.float64)
            rows = rows + torch.from_numpy(self.slopes(here, tip_in_world)) @ moved
        return TensorPose(rows[:, :9].reshape(-1, 3, 3), rows[:, 9:])

    def rows(self, values: np.ndarray, tip_in_world: Pose) -> np.ndarray:
        """Rotation by rows and position of each link's frame, (K, 12), at values (P,)."""
        turns, places, _ = self._frames(self._angles(values), tip_in_world)
        return np.concatenate([turns.reshape(-1, 9), places], axis=1)

    def slopes(self, values: np.ndarray, tip_in_world: Pose) -> np.ndarray:
        """How `rows` change with the values, (K, 12, P)."""
        turns, places, axes = self._frames(self._angles(values), tip_in_world)
        count = len(self._chain)
        joint = np.repeat(np.arange(count), 2)  # link that carries each axis
        below = (np.arange(count)[:, None] >= joint).astype(np.float64)  # (K, 2K)
        # Axis x column of the rotation, and axis x lever.
        turning = np.cross(axes[None, :, None], np.swapaxes(turns, 1, 2)[:, None])  # (K, 2K, column, row)
        moving = np.cross(axes[None], places[:, None] - places[joint][None])  # (K, 2K, 3)
        rows = np.concatenate([np.swapaxes(turning, 2, 3).reshape(count, -1, 9), moving], axis=2)
        by_angle = rows * below[..., None]
        return np.einsum("kac,ap->kcp", by_angle, self._angle_slopes(values))

    def _angles(self, values: np.ndarray) -> np.ndarray:
        return checked_angles(self._chain, self._task.chain_angles(values))

    def _angle_slopes(self, values: np.ndarray) -> np.ndarray:
        """(2K, P)."""
        columns = []
        for k, scale in enumerate(self._scale):
            h = np.zeros_like(values)
            h[k] = _STEP * scale
            ends = self._task.chain_angles(values + h) - self._task.chain_angles(values - h)
            columns.append(ends / (2 * h[k]))
        return np.stack(columns, axis=1)

    def _frames(self, angles: np.ndarray, tip: Pose) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rotations (K, 3, 3), joints (K, 3) [m] and axes (2K, 3), as `tasks.chain.link_poses`."""
        turn, place = tip.rotation, tip.position
        cosines, sines = np.cos(angles).reshape(-1, 2), np.sin(angles).reshape(-1, 2)
        turns, places, axes = [], [], []
        for link, (cx, cy), (sx, sy) in zip(self._chain, cosines, sines, strict=True):
            axes.append(turn[:, 0])
            turn = turn @ np.array([[cy, 0.0, sy], [sx * sy, cx, -sx * cy], [-cx * sy, sx, cx * cy]])
            axes.append(turn[:, 1])
            turns.append(turn)
            places.append(place)
            place = place + link.length * turn[:, 2]
        return np.array(turns), np.array(places), np.array(axes)
