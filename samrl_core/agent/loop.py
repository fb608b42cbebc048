"""Which stage of Algorithm 1 comes next; the library's loop and the cell's supervisor ask here."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from samrl_core.tasks.task import Task

Stage = Literal["view", "act", "done", "action_limit", "lost"]


@dataclass(frozen=True)
class LoopSettings:
    """When to look, and when to stop."""

    max_actions: int  # per episode
    view_period: int = 3  # actions from one search for a better view to the next
    looks: int = 1  # camera moves in one search; the model is updated after each (line 5's loop)
    max_lost_updates: int = 5  # updates in a row that may miss the target
    believe: bool = True  # end when the model says done; off where it is not updated and knows nothing of it


@dataclass(frozen=True)
class LoopState:
    """Where an episode stands."""

    step: int = 0  # actions executed
    looked: int = 0  # answers of the view search since the last action
    lost_updates: int = 0  # in a row


def stage_after_update(
    task: Task, values: np.ndarray, tip_position: np.ndarray, state: LoopState, settings: LoopSettings
) -> Stage:
    """What follows an update of the model.

    Args:
        task: judges by the estimate whether it is done.
        values: (P,) estimated.
        tip_position: (3,) in the tool arm's base frame [m].
        state: counts, this update included.
        settings: limits.

    Returns:
        "view" or "act"; or how the episode ends: "done" as the model believes, "action_limit", "lost".
    """
    if state.lost_updates > settings.max_lost_updates:
        return "lost"
    if settings.believe and task.is_done(values, tip_position):
        return "done"
    if state.step >= settings.max_actions:
        return "action_limit"
    if state.looked < settings.looks and state.step % settings.view_period == 0:
        return "view"
    return "act"
