"""Several states of a task as one batch of the model's motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch

from samrl_core.common.errors import SolveError
from samrl_core.model.task_dynamics.task_dynamics import TaskDynamics, TaskState


def joined(states: Sequence[TaskState]) -> TaskState:
    """All states in one batch."""
    return TaskState(*(torch.cat([getattr(one, name) for one in states]) for name in ("q", "v", "rest")))


def rows(states: TaskState, which: Sequence[int] | np.ndarray) -> TaskState:
    """Some states of a batch, as copies: the others can be forgotten."""
    index = torch.as_tensor(np.asarray(which, dtype=np.int64))
    return TaskState(states.q[index], states.v[index], states.rest[index])


def moved(dynamics: TaskDynamics, states: TaskState, actions: np.ndarray) -> tuple[TaskState, np.ndarray]:
    """Every state after its action, and which were solved (B,) bool; an unsolved one stays as it was.

    Args:
        dynamics: eq. 3.
        states: B of them.
        actions: (B, 3) displacement of the tip [m].
    """
    displacement = torch.from_numpy(np.asarray(actions, dtype=np.float64))
    count = len(displacement)
    with torch.no_grad():
        try:
            return dynamics.forward(states, displacement), np.ones(count, dtype=bool)
        except SolveError:  # of one of them; the others must not suffer
            solved = np.ones(count, dtype=bool)
            after = [rows(states, [i]) for i in range(count)]
            for i in range(count):
                try:
                    after[i] = dynamics.forward(after[i], displacement[i : i + 1])
                except SolveError:
                    solved[i] = False
            return joined(after), solved
