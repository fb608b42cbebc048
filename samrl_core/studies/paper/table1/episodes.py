"""Table I's episodes: groups of them side by side in the model, in a process of their own."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.learning.images.appearance import AppearanceSettings
from samrl_core.learning.images.batch_render import model_of
from samrl_core.learning.images.image_noise import ImageNoiseSettings
from samrl_core.learning.sim.rollouts import RolloutSettings, roll_out
from samrl_core.learning.states.explore import Starts
from samrl_core.learning.states.frames import SceneFrames
from samrl_core.model.model import Model
from samrl_core.policy.agent.loop import LoopSettings
from samrl_core.policy.view.sensing_value import Networks
from samrl_core.policy.view.view_reach import ReachSettings, View, ViewReach
from samrl_core.policy.view.view_search import ViewAscentSettings
from samrl_core.studies.experiment import Case
from samrl_core.studies.paper.table1.views import (
    ONCE,
    Chooser,
    MovingCamera,
    ViewSetup,
    at_random,
    by_ascent,
    by_true_error,
    stays,
    to_one,
)
from samrl_core.studies.paper.view_bench import view_bench

# In the order of the table. `best_fixed` holds the grid's view that did best on other starts.
CONDITIONS = ("active", "best_fixed", "held_random", "fixed", "random_each_step", "oracle")
TEST, CHOICE = 0, 1  # streams of starts: those of the table, and those that the best fixed view is chosen on


@dataclass(frozen=True)
class TableSettings:
    """Sizes of the table. Those of the choice of the fixed view are for as many episodes as `episodes`."""

    views: ViewAscentSettings = ViewAscentSettings()
    view_period: int = LoopSettings.view_period  # actions from one search to the next
    episodes: int = 200  # of active and best fixed view
    few_share: float = 0.25  # of them in the other conditions
    side_by_side: int = 25  # episodes of one group
    oracle_views: int = 12  # at most, of which the oracle takes the best
    first: int = 12  # episodes from every view of the grid
    finalists: int = 6  # views that did best in these
    more: int = 48  # episodes from each of the finalists
    max_actions: int = 0  # of an episode; 0 takes the task's


@dataclass(frozen=True)
class Group:
    """Episodes that are run together; what comes out depends on nothing else."""

    task: str
    weights: Path | None  # folder of the networks; None: the package's
    noisy: bool  # colours, light and camera noise vary; else the model's own, clean
    condition: str
    view: int  # of `fixed_views`, for `best_fixed`
    seed: int
    stream: int
    first: int  # number of the first episode
    count: int
    device: str
    settings: TableSettings
    cell: str = DEFAULT_CELL

    @property
    def key(self) -> str:
        """Names the case."""
        weights = "package" if self.weights is None else self.weights.name
        what = f"{self.condition}-{self.view}" if self.condition == "best_fixed" else self.condition
        where = "choice" if self.stream == CHOICE else "table"
        noise = "noisy" if self.noisy else "clean"
        return f"{self.task}/{weights}/{noise}/{where}/{what}/{self.first}-{self.first + self.count}"


def fixed_views(reach: ViewReach, task: str, cell: str) -> list[View]:
    """Views of the grid that may be held: clear as an episode begins, at the nominal values."""
    plan = task_named(task)
    nominal = np.array([p.nominal for p in plan.parameters()])
    tool = plan.start_joints(cell_named(cell))["tool_arm"]
    return reach.clear_views(reach.obstacles(tool, nominal))


def run_group(group: Group) -> list[Case]:
    """One case: success, number of actions and seconds of camera motion of each episode."""
    s = group.settings
    bench_of_task = view_bench(group.task, group.cell, group.device, group.weights)
    bench, networks = (
        ViewSetup(bench_of_task.renderer, _reach(group.task, group.cell, s.views.reach)),
        bench_of_task.networks,
    )
    camera = MovingCamera(bench, group.count, *_chooser(group, bench, networks), s.views.speed_share)
    settings = RolloutSettings(
        max_actions=s.max_actions,
        appearances=AppearanceSettings() if group.noisy else None,
        noise=ImageNoiseSettings() if group.noisy else None,
    )
    # The same appearances and the same noise in all conditions, as far as their episodes are the same.
    rng = np.random.default_rng([group.seed, 2, group.stream, group.first])
    actor, model = networks.actor, bench.renderer.model
    found = roll_out(model, bench.renderer, actor, _starts(group, model), camera, settings, rng)
    return [
        {
            "key": group.key,
            "successes": int(found.success.sum()),
            "episodes": group.count,
            "success": found.success.tolist(),
            "actions": found.actions.tolist(),
            "camera_s": np.round(camera.seconds, 4).tolist(),
        }
    ]


def _starts(group: Group, model: Model) -> Starts:
    """Each follows from its own number, so that all conditions have the same."""
    numbers = range(group.first, group.first + group.count)
    generators = [np.random.default_rng([group.seed, group.stream, number]) for number in numbers]
    values = np.array([model.task.start_values(rng) for rng in generators])
    return Starts(values, np.tile(SceneFrames(model).start_tip, (group.count, 1)))


def _chooser(group: Group, bench: ViewSetup, networks: Networks) -> tuple[Chooser, int]:
    """Who chooses views, and how often."""
    s = group.settings
    if group.condition == "active":
        return by_ascent(bench, networks, s.views), s.view_period
    if group.condition == "oracle":
        return by_true_error(bench, networks, s.oracle_views), s.view_period
    if group.condition == "random_each_step":
        return at_random(bench), 1
    if group.condition == "held_random":
        return at_random(bench), ONCE
    if group.condition == "best_fixed":
        return to_one(fixed_views(bench.reach, group.task, group.cell)[group.view]), ONCE
    return stays, ONCE


@cache
def _reach(task: str, cell: str, settings: ReachSettings) -> ViewReach:
    """One per process: the grid is solved once."""
    model = model_of(task, cell)
    return ViewReach(model.cell, model.task, settings)
