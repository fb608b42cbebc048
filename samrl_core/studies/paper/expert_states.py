"""States along the expert's trajectory in the model, at which figures evaluate the networks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.learning.states.frames import SceneFrames
from samrl_core.learning.states.state_batch import moved
from samrl_core.model.model import Model
from samrl_core.policy.planning.expert import label_of

PHASES = (0.15, 0.50, 0.85)  # of an expert's episode


@dataclass(frozen=True, eq=False)
class ExpertState:
    """One state of an episode of the expert, and what it does there."""

    phase: float  # share of the episode's actions that lie behind, as asked for
    step: int  # actions that lie behind
    values: np.ndarray  # (P,)
    tip_in_base: np.ndarray  # (3,) [m]
    frames: np.ndarray  # (F, 12) of `SceneFrames`
    action: np.ndarray  # (3,) of the expert [m]
    sub_goal: str  # that it heads for


def expert_states(model: Model, seed: int, phases: tuple[float, ...] = PHASES) -> list[ExpertState]:
    """One state per phase of one episode, from a random start of the task.

    Args:
        model: moves, and names the expert's actions.
        seed: of the start.
        phases: shares 0..1 of the episode's actions.

    Raises:
        InputError: phases outside 0..1.
        ReachError: the arm does not reach such a state.
    """
    if not all(0.0 <= phase < 1.0 for phase in phases):
        raise InputError(f"phases are {phases}, must lie within 0..1, 1 excluded")
    task, dynamics, frames = model.task, model.dynamics, SceneFrames(model)
    values = task.start_values(np.random.default_rng([seed, 6]))
    state = dynamics.start(values, frames.start_tip)
    way = []
    for _ in range(task.max_actions):
        values, tip = dynamics.read(state.q[0].numpy())
        label = label_of(dynamics, task, values, tip)
        if label.sub_goal == "none":
            break
        way.append((values, tip, label))
        state, solved = moved(dynamics, state, label.action[None])
        if not solved[0]:
            break
    found = []
    for phase in phases:
        step = int(phase * len(way))
        values, tip, label = way[step]
        rows = frames.rows(values, frames.joints(tip)).astype(np.float32)
        found.append(ExpertState(phase, step, values, tip, rows, label.action, label.sub_goal))
    return found
