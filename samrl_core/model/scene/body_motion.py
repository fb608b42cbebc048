"""Poses of the bodies that a task's parameters move, as tensors with their Jacobian."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch

from samrl_core.cell.tasks.task import Task
from samrl_core.common.errors import InputError

_STEP = 1e-4  # of a parameter's scale; poses are smooth, and rounding stays at 1e-11 of the scale


@dataclass(frozen=True, eq=False)
class TensorPose:
    """A pose in world as float64 tensors."""

    rotation: torch.Tensor  # (3, 3)
    position: torch.Tensor  # (3,) [m]


def checked_values(values: torch.Tensor, count: int) -> np.ndarray:
    """The values of a tensor (P,), float64.

    Raises:
        InputError: wrong shape or a non-finite value.
    """
    if tuple(values.shape) != (count,):
        raise InputError(f"values have shape {tuple(values.shape)}, the task declares {(count,)}")
    here = values.detach().cpu().numpy().astype(np.float64)
    if not np.isfinite(here).all():
        raise InputError(f"values {here} must be finite; check the estimate's last update")
    return here


def first_order(rows: np.ndarray, jacobians: Callable[[], np.ndarray], values: torch.Tensor) -> torch.Tensor:
    """Rows (..., 12) as a tensor whose gradient by `values` (P,) is `jacobians` (..., 12, P), if wanted."""
    tensor = torch.from_numpy(rows)
    if not (values.requires_grad and torch.is_grad_enabled()):
        return tensor
    moved = (values - values.detach()).to("cpu", torch.float64)
    return tensor + torch.from_numpy(jacobians()) @ moved


def central_differences(
    function: Callable[[np.ndarray], np.ndarray], values: np.ndarray, scale: np.ndarray
) -> np.ndarray:
    """Slope (..., P) of a function of parameters (P,), which have these scales, by central differences."""
    columns = []
    for k, step in enumerate(_STEP * scale):
        h = np.zeros_like(values)
        h[k] = step
        columns.append((function(values + h) - function(values - h)) / (2 * step))
    return np.stack(columns, axis=-1)


class BodyMotion:
    """Poses and their Jacobians by central differences of `Task.body_poses`, which knows no tensors.

    Where the parameters say that a body is larger than drawn, its rotation has columns as long as that.
    """

    def __init__(self, task: Task) -> None:
        """Remembers the last values, since a minimiser and a planner ask for the same ones again."""
        self._task = task
        self._scale = np.array([p.scale for p in task.parameters()])
        self._rows_at: tuple[bytes, dict[str, np.ndarray]] | None = None
        self._jacobians_at: tuple[bytes, dict[str, np.ndarray]] | None = None

    def __call__(self, values: torch.Tensor) -> dict[str, TensorPose]:
        """Poses at `values` (P,), exact in value, first order in gradient.

        Raises:
            InputError: wrong shape or a non-finite value.
        """
        here = checked_values(values, len(self._scale))
        return {
            name: TensorPose(flat[:9].reshape(3, 3), flat[9:])
            for name, rows in self.rows(here).items()
            for flat in [first_order(rows, lambda name=name: self.jacobians(here)[name], values)]
        }

    def rows(self, values: np.ndarray) -> dict[str, np.ndarray]:
        """Rotation by rows and position (12,) of each body at `values` (P,)."""
        key = values.tobytes()
        if self._rows_at is None or self._rows_at[0] != key:
            self._rows_at = (key, self._rows(values))
        return self._rows_at[1]

    def jacobians(self, values: np.ndarray) -> dict[str, np.ndarray]:
        """How `rows` change with the values, (12, P) of each body."""
        key = values.tobytes()
        if self._jacobians_at is None or self._jacobians_at[0] != key:
            names = list(self.rows(values))
            jacobians = {}
            if names:
                every = central_differences(
                    lambda v: np.array(list(self._rows(v).values())), values, self._scale
                )
                jacobians = dict(zip(names, every, strict=True))
            self._jacobians_at = (key, jacobians)
        return self._jacobians_at[1]

    def _rows(self, values: np.ndarray) -> dict[str, np.ndarray]:
        """Rotation by rows and position, (12,) per body."""
        scales, rows = self._task.body_scales(values), {}
        for name, pose in self._task.body_poses(values).items():
            turn = pose.rotation * scales[name] if name in scales else pose.rotation
            rows[name] = np.concatenate([turn.ravel(), pose.position])
        return rows
