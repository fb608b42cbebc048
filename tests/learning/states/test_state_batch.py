"""Batches of states: one that cannot be solved does not hold the others up."""

from __future__ import annotations

import numpy as np
import torch

from samrl_core.common.errors import SolveError
from samrl_core.learning.states.state_batch import joined, moved, rows
from samrl_core.model.task_dynamics.task_dynamics import TaskDynamics, TaskState


class Brittle(TaskDynamics):
    """Adds the action to the tip; nothing can be solved below the table."""

    def prepare(self) -> None:
        pass

    def start(self, values: np.ndarray, tip_position: np.ndarray) -> TaskState:
        return TaskState(torch.tensor(tip_position)[None], torch.zeros((1, 0)), torch.zeros((1, 0)))

    def forward(self, state: TaskState, action: torch.Tensor) -> TaskState:
        q = state.q + action
        if bool((q[:, 2] < 0).any()):
            raise SolveError("below the table")
        return TaskState(q, state.v, state.rest)

    def read(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(0), q


def test_an_unsolved_state_stays_alone() -> None:
    dynamics = Brittle()
    states = joined([dynamics.start(np.zeros(0), np.array([0.1 * k, 0.0, 0.05])) for k in range(3)])
    down = np.array([[0.0, 0.0, -0.01], [0.0, 0.0, -0.06], [0.0, 0.0, -0.02]])
    after, solved = moved(dynamics, states, down)
    assert solved.tolist() == [True, False, True]
    np.testing.assert_allclose(after.q.numpy()[:, 2], [0.04, 0.05, 0.03])
    after, solved = moved(dynamics, states, np.abs(down))
    assert solved.all()
    np.testing.assert_allclose(after.q.numpy(), states.q.numpy() + np.abs(down))


def test_rows_are_copies() -> None:
    dynamics = Brittle()
    states = joined([dynamics.start(np.zeros(0), np.array([0.1 * k, 0.0, 0.05])) for k in range(3)])
    few = rows(states, [2, 0])
    np.testing.assert_array_equal(few.q.numpy(), states.q.numpy()[[2, 0]])
    few.q.zero_()
    np.testing.assert_array_equal(states.q[0].numpy(), [0.0, 0.0, 0.05])
