"""Groups of an actor's episodes in the model, run by several processes; each follows from its own seed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import torch

from samrl_core.common.executor import run_calls
from samrl_core.learning.images.appearance import AppearanceSettings, AppearanceSource
from samrl_core.learning.images.image_noise import ImageNoiseSettings
from samrl_core.learning.images.models import renderer_of
from samrl_core.learning.randomisation.distributions import ParameterDistribution
from samrl_core.learning.randomisation.of_task import (
    LOOK,
    AppearancesAt,
    dynamics_at,
    start_values,
    with_one_attribute,
)
from samrl_core.learning.sim.rollouts import ActorRollouts, RolloutSettings, held, new_each_step, roll_out
from samrl_core.learning.states.explore import Starts
from samrl_core.learning.states.frames import SceneFrames
from samrl_core.model.model import Model
from samrl_core.model.task_dynamics.task_dynamics import TaskDynamics
from samrl_core.policy.networks.networks import SimActor
from samrl_core.policy.view.views import draw_views

Weights = dict[str, torch.Tensor]


@dataclass(frozen=True, eq=False)
class EpisodeGroup:
    """Episodes from the task's own starts, or from those of a distribution, side by side.

    What a distribution leaves out is as the task, or `AppearanceSettings`, has it. All episodes have the same
    physical attributes: those of the first point.
    """

    seed: tuple[int, ...]  # of all that is random in it
    count: int
    hold: bool  # one random view for each episode; else a new one for every action
    action_noise: float  # per axis, standard deviation [action limits]
    noisy: bool  # colours, light and camera noise vary; else the model's own, clean
    max_actions: int  # of an episode; 0 takes the task's
    drawn: ParameterDistribution | None = None
    points: np.ndarray | None = None  # (count, P) of the distribution's space; None draws them


def run_groups(
    task: str, actor: SimActor, groups: Sequence[EpisodeGroup], device: str, workers: int
) -> Iterator[tuple[int, ActorRollouts]]:
    """Each group's number and episodes, in the order in which they end.

    Args:
        task: name of the task.
        actor: acts.
        groups: what is run; the result of each does not depend on the others.
        device: of the images and the actor.
        workers: processes; 1 runs them here, one after the other.
    """
    weights = {name: value.detach().cpu() for name, value in actor.state_dict().items()}
    for done in run_calls([partial(_run, task, weights, group, device) for group in groups], workers):
        yield done.index, done.result


def _run(task: str, weights: Weights, group: EpisodeGroup, device: str) -> ActorRollouts:
    renderer = renderer_of(task, device)
    model, rng = renderer.model, np.random.default_rng(group.seed)
    actor = SimActor(model.task.action_limit)
    actor.load_state_dict(weights)
    actor.to(renderer.device).eval()
    values, appearances, dynamics = begun(model, group, rng)
    starts = Starts(values, np.tile(SceneFrames(model).start_tip, (group.count, 1)))
    region = model.task.view_region()
    viewer = held(draw_views(region, rng, group.count)) if group.hold else new_each_step(region)
    settings = RolloutSettings(
        max_actions=group.max_actions,
        action_noise=group.action_noise,
        appearances=appearances if group.noisy else None,
        noise=ImageNoiseSettings() if group.noisy else None,
    )
    return roll_out(model, renderer, actor, starts, viewer, settings, rng, dynamics)


def begun(
    model: Model, group: EpisodeGroup, rng: np.random.Generator
) -> tuple[np.ndarray, AppearanceSource, TaskDynamics]:
    """Values (count, P) at the start, how the images look, and how the model moves.

    Raises:
        InputError: points that differ in physical attributes.
    """
    if group.drawn is None:
        values = np.array([model.task.start_values(rng) for _ in range(group.count)])
        return values, AppearanceSettings(), model.dynamics
    space, points = group.drawn.space, group.points
    if points is None:
        points = with_one_attribute(space, group.drawn.sample(rng, group.count))
    appearances = AppearancesAt(space, points) if space.columns(LOOK) else AppearanceSettings()
    return start_values(model.task, space, points), appearances, dynamics_at(model.dynamics, space, points)
