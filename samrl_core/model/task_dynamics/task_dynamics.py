"""Dynamics as a planner needs them (eq. 3): a state, the step by an action, and how to read the state."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
import torch


@dataclass(frozen=True, eq=False)
class TaskState:
    """B states of one task: the tool's tip, and what it touches."""

    q: torch.Tensor  # (B, Q) coordinates; `TaskDynamics.read` needs no more [m], [rad]
    v: torch.Tensor  # (B, D) their velocities [m/s], [rad/s]
    rest: torch.Tensor  # (B, R) angles at which springs are slack; they do not change [rad]


class TaskDynamics(ABC):
    """Eq. 3 of one task. Float64, on the CPU; final implementations differ in what they take into account."""

    @abstractmethod
    def prepare(self) -> None:
        """Compiles what `forward` and its gradient need, or the first action would wait for it."""

    @abstractmethod
    def start(self, values: np.ndarray, tip_position: np.ndarray) -> TaskState:
        """States at rest at an estimate.

        Args:
            values: (B, P) in the order of `Task.parameters`.
            tip_position: (3,) in the tool arm's base frame [m].

        Raises:
            InputError: wrong shapes or non-finite numbers.
        """

    @abstractmethod
    def forward(self, state: TaskState, action: torch.Tensor) -> TaskState:
        """The state after one action; differentiable in state and action.

        Args:
            state: B states.
            action: (B, 3) displacement of the tip within one action's time [m].

        Raises:
            InputError: a wrong shape.
            SolveError: the equations of motion were not solved.
        """

    @abstractmethod
    def read(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Parameters (P,) and tip (3,) [m] of coordinates (Q,), to ask the task with."""
