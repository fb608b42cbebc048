"""Line 16 of Algorithm 1: what an episode of the agent leaves to learn from."""

from __future__ import annotations

import numpy as np

from samrl_core.agent.agent import Episode
from samrl_core.learn.visited import FITTED, VisitedStates
from samrl_core.model.model import Model


def visited_states(model: Model, episode: Episode, number: int = 0) -> VisitedStates:
    """The estimates before each action and after the last one, where an image was fitted.

    Args:
        model: that the agent has updated.
        episode: what `run_episode` gave.
        number: of the episode.
    """
    seen = [(step.observation, step.estimate) for step in episode.steps] + [(episode.last, episode.estimate)]
    rows = [(k, *pair) for k, pair in enumerate(seen) if pair[1].why_stopped in FITTED]
    size = len(model.task.parameters())
    tips = [model.tip_in_base(observation.tool_arm.position).position for _, observation, _ in rows]
    return VisitedStates(
        model.task.name,
        np.array([estimate.values for _, _, estimate in rows]).reshape(-1, size),
        np.array([estimate.covariance for _, _, estimate in rows]).reshape(-1, size, size),
        np.array(tips).reshape(-1, 3),
        np.full(len(rows), number, dtype=np.int64),
        np.array([k for k, _, _ in rows], dtype=np.int64),
    )
