"""Transitions of a replay, over one or more steps, and batches of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from samrl_core.learning.residual.replay import End, Replay


@dataclass(frozen=True, eq=False)
class Transitions:
    """Where each transition begins and ends, by numbers of steps (N,)."""

    start: np.ndarray  # (N,) step in whose state the residual was chosen
    after: np.ndarray  # (N,) step whose state the return goes on from; without meaning where discount is 0
    reward: np.ndarray  # (N,) discounted sum of eq. 16's rewards on the way
    discount: np.ndarray  # (N,) of what follows, 0 where the episode has ended
    episodes: int  # how many they are from

    def __len__(self) -> int:
        return int(self.start.size)


def transitions_of(replay: Replay, n_step: int, gamma: float) -> Transitions:
    """All transitions that are known whole, of `n_step` steps or as many as there are.

    A step counts when its successor is there or its episode ended with it, in success (reward 1) or with all
    actions used up (reward 0): both end the return, as in the paper. A step cut short by a fault counts only
    as what an earlier one led to.
    """
    numbers, episodes, steps, ends = replay.outline()
    ended = (ends == End.SUCCESS) | (ends == End.FAILURE)
    goes_on = np.zeros(numbers.size, dtype=bool)
    if numbers.size:
        neighbour = (np.diff(numbers) == 1) & (np.diff(episodes) == 0) & (np.diff(steps) == 1)
        goes_on[:-1] = (ends[:-1] == End.OPEN) & neighbour
    at = np.arange(numbers.size)
    alive = ended | goes_on
    known = alive.copy()
    reward, discount = np.zeros(numbers.size), np.ones(numbers.size)
    for _ in range(n_step):
        reward += np.where(alive & (ends[at] == End.SUCCESS), discount, 0.0)
        discount = np.where(alive & ended[at], 0.0, discount)
        alive = alive & goes_on[at]
        at = np.where(alive, at + 1, at)
        discount = np.where(alive, gamma * discount, discount)
    count = np.unique(episodes[known]).size
    return Transitions(numbers[known], numbers[at][known], reward[known], discount[known], count)


@dataclass(frozen=True, eq=False)
class Batch:
    """Transitions as tensors."""

    features: torch.Tensor  # (B, 128) of the real image before the action
    nominal: torch.Tensor  # (B, 3) [m]
    residual: torch.Tensor  # (B, 3) as it was applied [m]
    reward: torch.Tensor  # (B,)
    discount: torch.Tensor  # (B,)
    next_features: torch.Tensor  # (B, 128)
    next_nominal: torch.Tensor  # (B, 3) [m]
    episodes: int  # of all that these were drawn from
