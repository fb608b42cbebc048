"""Labelled states of a task, sampled in the model: the first stage of learning (paper, section III-D)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from samrl_core.cell.tasks.task import Task
from samrl_core.common.errors import InputError, ReachError
from samrl_core.learning.randomisation.distributions import ParameterDistribution
from samrl_core.learning.randomisation.of_task import dynamics_at, start_values
from samrl_core.learning.states.explore import Explorer, ExploreSettings, Starts
from samrl_core.learning.states.frames import SceneFrames
from samrl_core.learning.states.states import StateSamples
from samrl_core.model.model import Model


@dataclass(frozen=True, eq=False)
class StateSource:
    """What labelled states are sampled from."""

    explore: ExploreSettings = ExploreSettings()  # how widely they are spread
    given: Starts | None = None  # to begin in besides the task's own starts, e.g. estimates of Real2Sim
    distribution: ParameterDistribution | None = None  # of starts and parameters; None: the task's


def sample_states(
    model: Model, rng: np.random.Generator, count: int, source: StateSource | None = None
) -> StateSamples:
    """So many labelled states; the same ones for the same generator.

    Args:
        model: of the task; its dynamics move and label the states.
        rng: source of everything random.
        count: how many, at least 1.
        source: where they come from.

    Raises:
        InputError: a count below 1, or no start that can be used.
    """
    if count < 1:
        raise InputError(f"{count} states were asked for, must be at least 1")
    source = source or StateSource()
    frames, dynamics, starts, distribution = SceneFrames(model), model.dynamics, None, source.distribution
    if distribution is not None:
        dynamics = dynamics_at(dynamics, distribution.space, distribution.sample(rng, 1))
        starts = partial(_start, model.task, distribution)
    explorer = Explorer(dynamics, model.task, frames.start_tip, rng, source.explore, source.given, starts)
    rows: list[tuple[np.ndarray, ...]] = []
    goals: list[str] = []
    solved: list[bool] = []
    for one in explorer.visit():
        try:
            joints = frames.joints(one.tip)
        except ReachError:
            continue  # the real arm could not be there either
        moved = frames.rows(one.values, joints).astype(np.float32)
        rows.append((one.values, one.tip, joints, moved, one.label.action))
        goals.append(one.label.sub_goal)
        solved.append(one.label.solved)
        if len(rows) == count:
            break
    values, tips, joints, all_frames, actions = (np.array(column) for column in zip(*rows, strict=True))
    return StateSamples(values, tips, joints, all_frames, actions, np.array(goals), np.array(solved))


def _start(task: Task, distribution: ParameterDistribution, rng: np.random.Generator) -> np.ndarray:
    return start_values(task, distribution.space, distribution.sample(rng, 1))[0]
