"""Groups of an actor's episodes in the model, run by several processes; each follows from its own seed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import torch

from samrl_core.cell.calibration.cell_correction import NO_CORRECTION, CellCorrection
from samrl_core.cell.robots.cells import DEFAULT_CELL
from samrl_core.common.array_file import read_arrays, write_arrays
from samrl_core.common.executor import free_cores, run_calls
from samrl_core.common.streams import stream
from samrl_core.learning.images.appearance import AppearanceSettings, AppearanceSource
from samrl_core.learning.images.batch_render import renderer_of
from samrl_core.learning.images.image_noise import ImageNoiseSettings
from samrl_core.learning.randomisation.distributions import ParameterDistribution
from samrl_core.learning.randomisation.of_task import (
    APPEARANCE,
    AppearancesAt,
    dynamics_at,
    start_values,
    with_one_set_of_parameters,
)
from samrl_core.learning.sim.rollouts import ActorRollouts, RolloutSettings, held, new_each_step, roll_out
from samrl_core.learning.states.explore import Starts
from samrl_core.learning.states.frames import SceneFrames
from samrl_core.model.model import Model
from samrl_core.model.task_dynamics.task_dynamics import TaskDynamics
from samrl_core.policy.networks.networks import SimActor
from samrl_core.policy.view.views import sample_views

Log = Callable[[dict[str, float]], None]  # receives the number of groups done


def run_cached_groups(
    task: str,
    actor: SimActor,
    groups: Sequence[EpisodeGroup],
    names: Sequence[str],
    folder: Path,
    device: str,
    workers: int,
    log: Log,
) -> list[dict[str, np.ndarray]]:
    """Each group's arrays, in the order of the groups: run now, or read from the file of an earlier call.

    Args:
        task: name of the task.
        actor: acts.
        groups: each follows from its own seed; the folder is of these alone.
        names: fields of `Rollouts` that are kept; `success` is one of them.
        folder: gets a file for each group as soon as it has ended.
        device: of the images and the actor.
        workers: processes; 0 takes the free cores.
        log: called at first and after each group.

    Raises:
        InputError: a file is damaged or another's; otherwise as `run_groups`.
    """
    paths = [folder / f"{k:04d}.npz" for k in range(len(groups))]
    missing = [k for k, path in enumerate(paths) if not path.exists()]
    done = len(paths) - len(missing)
    log({"groups": done, "of": len(paths)})
    left = [groups[k] for k in missing]
    for k, run in run_groups(task, actor, left, device, workers or free_cores()):
        write_arrays(paths[missing[k]], {name: getattr(run, name) for name in names})
        done += 1
        log({"groups": done, "of": len(paths), "success": float(run.success.mean())})
    return [read_arrays(path, names) for path in paths]


Weights = dict[str, torch.Tensor]


@dataclass(frozen=True, eq=False)
class EpisodeGroup:
    """Episodes from the task's own starts, or from those of a distribution, side by side.

    What a distribution leaves out is as the task, or `AppearanceSettings`, has it. All episodes have the same
    physical parameters: those of the first point.
    """

    seed: int  # of the training
    stream: tuple[str | int, ...]  # what its random numbers are drawn for; no other group has the same
    count: int
    hold: bool  # one random view for each episode; else a new one for every action
    action_noise: float  # per axis, standard deviation [action limits]
    noisy: bool  # colours, light and camera noise vary; else the model's own, clean
    max_actions: int  # of an episode; 0 takes the task's
    distribution: ParameterDistribution | None = None
    points: np.ndarray | None = None  # (count, P) of the distribution's space; None samples them
    cell: str = DEFAULT_CELL  # whose arm moves and whose camera looks
    correction: CellCorrection = NO_CORRECTION  # whose posterior noisy episodes' cells are drawn from


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
    renderer = renderer_of(task, group.cell, device)
    model, rng = renderer.model, stream(group.seed, *group.stream)
    actor = SimActor(model.task.action_limit)
    actor.load_state_dict(weights)
    actor.to(renderer.device).eval()
    values, appearances, dynamics = begun(model, group, rng)
    starts = Starts(values, np.tile(SceneFrames(model).start_tip, (group.count, 1)))
    region = model.task.view_region()
    viewer = held(sample_views(region, rng, group.count)) if group.hold else new_each_step(region)
    settings = RolloutSettings(
        max_actions=group.max_actions,
        action_noise=group.action_noise,
        appearances=appearances if group.noisy else None,
        noise=ImageNoiseSettings() if group.noisy else None,
        correction=group.correction if group.noisy else NO_CORRECTION,
    )
    return roll_out(model, renderer, actor, starts, viewer, settings, rng, dynamics)


def begun(
    model: Model, group: EpisodeGroup, rng: np.random.Generator
) -> tuple[np.ndarray, AppearanceSource, TaskDynamics]:
    """Values (count, P) at the start, appearances of the images, and dynamics of the model.

    Raises:
        InputError: points that differ in physical parameters.
    """
    if group.distribution is None:
        values = np.array([model.task.start_values(rng) for _ in range(group.count)])
        return values, AppearanceSettings(), model.dynamics
    space, points = group.distribution.space, group.points
    if points is None:
        points = with_one_set_of_parameters(space, group.distribution.sample(rng, group.count))
    appearances = AppearancesAt(space, points) if space.columns(APPEARANCE) else AppearanceSettings()
    return start_values(model.task, space, points), appearances, dynamics_at(model.dynamics, space, points)
