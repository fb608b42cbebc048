"""Poses of the bodies that a task's parameters move, as tensors with their slope."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from samrl_core.errors import InputError
from samrl_core.tasks.task import Task

_STEP = 1e-4  # of a parameter's scale; poses are smooth, and rounding stays at 1e-11 of the scale


@dataclass(frozen=True, eq=False)
class TensorPose:
    """A pose in world as float64 tensors."""

    rotation: torch.Tensor  # (3, 3)
    position: torch.Tensor  # (3,) [m]


class BodyMotion:
    """Poses and their Jacobians by central differences of `Task.body_poses`, which knows no tensors."""

    def __init__(self, task: Task) -> None:
        """Remembers the last values, since a minimiser and a planner ask for the same ones again."""
        self._task = task
        self._scale = np.array([p.scale for p in task.parameters()])
        self._rows_at: tuple[bytes, dict[str, np.ndarray]] | None = None
        self._slopes_at: tuple[bytes, dict[str, np.ndarray]] | None = None

    def __call__(self, values: torch.Tensor) -> dict[str, TensorPose]:
        """Poses at `values` (P,), exact in value, first order in gradient.

        Raises:
            InputError: wrong shape or a non-finite value.
        """
        if tuple(values.shape) != self._scale.shape:
            raise InputError(
                f"values have shape {tuple(values.shape)}, the task declares {self._scale.shape}"
            )
        here = values.detach().cpu().numpy().astype(np.float64)
        if not np.isfinite(here).all():
            raise InputError(f"values {here} must be finite; check the estimate's last update")
        poses = self.rows(here)
        flat = {name: torch.from_numpy(rows) for name, rows in poses.items()}
        if values.requires_grad and torch.is_grad_enabled():
            slopes = self.slopes(here)
            moved = (values - values.detach()).to("cpu", torch.float64)
            flat = {name: rows + torch.from_numpy(slopes[name]) @ moved for name, rows in flat.items()}
        return {name: TensorPose(rows[:9].reshape(3, 3), rows[9:]) for name, rows in flat.items()}

    def rows(self, values: np.ndarray) -> dict[str, np.ndarray]:
        """Rotation by rows and position (12,) of each body at `values` (P,)."""
        key = values.tobytes()
        if self._rows_at is None or self._rows_at[0] != key:
            self._rows_at = (key, self._rows(values))
        return self._rows_at[1]

    def slopes(self, values: np.ndarray) -> dict[str, np.ndarray]:
        """How `rows` change with the values, (12, P) of each body."""
        key = values.tobytes()
        if self._slopes_at is None or self._slopes_at[0] != key:
            names = list(self.rows(values))
            columns = []
            for k, scale in enumerate(self._scale if names else ()):
                h = np.zeros_like(values)
                h[k] = _STEP * scale
                up, down = self._rows(values + h), self._rows(values - h)
                columns.append({n: (up[n] - down[n]) / (2 * h[k]) for n in names})
            slopes = {
                n: np.stack([c[n] for c in columns], axis=1) if columns else np.zeros((12, 0)) for n in names
            }
            self._slopes_at = (key, slopes)
        return self._slopes_at[1]

    def _rows(self, values: np.ndarray) -> dict[str, np.ndarray]:
        """Rotation by rows and position, (12,) per body."""
        return {
            name: np.concatenate([pose.rotation.ravel(), pose.position])
            for name, pose in self._task.body_poses(values).items()
        }
