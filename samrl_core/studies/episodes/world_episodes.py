"""One episode of Algorithm 1 in a PyBullet world as an experiment's case: evaluated by truth, and timed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from samrl_core.cell.calibration.cell_correction import NO_CORRECTION, CellCorrection
from samrl_core.cell.instance.cell_instance import NOMINAL, instance_named
from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.world.evaluation import evaluate_now
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.common.errors import SamrlError
from samrl_core.common.executor import Workers
from samrl_core.model.model import Model
from samrl_core.model.scene.settings import ModelSettings
from samrl_core.policy.agent.agent import Agent
from samrl_core.policy.agent.episode import run_episode
from samrl_core.policy.agent.loop import LoopSettings
from samrl_core.policy.agent.policies import TOUCH
from samrl_core.policy.agent.settings import AgentSettings, announced_residual, trained_networks
from samrl_core.policy.networks.weights import sha256_of
from samrl_core.studies.episodes.differing_world import differing_world
from samrl_core.studies.episodes.stopwatch import Stopwatch
from samrl_core.studies.episodes.straw_men import run_straw_man
from samrl_core.studies.episodes.world_plant import WorldPlant
from samrl_core.studies.experiment import Case, CaseLog, Progress, run_cases

HELD = "held"  # besides the agent's strategies: the view that the episode starts with


@dataclass(frozen=True)
class Condition:
    """How the agent is asked to work.

    Raises:
        InputError: from `AgentSettings`, where it is used.
    """

    policy: str = "learned"  # of `samrl_core.policy.agent.policies.POLICIES`
    strategy: str = "q"  # of `samrl_core.policy.agent.policies.STRATEGIES`, or HELD
    update: bool = True  # Real2Sim
    residual: bool = False
    view_period: int = LoopSettings.view_period  # actions from one search for a view to the next
    tip_offset: bool = False  # see `AgentSettings`
    touch: bool = False  # the same
    doubt: float = 1.0  # the same
    sees_tip: bool = True  # the same
    sees_colours: bool = True  # the same
    most_updates: int | None = None  # the same
    remembers: bool = False  # one agent goes through the episodes of a cell, in their order
    think_s: float = 0.0  # from an image to the action that follows from it, while the world goes on [s]
    straw_man: str = ""  # of `STRAW_MEN`, in place of Algorithm 1; empty for none


def usual_condition(task: str) -> Condition:
    """The loop as a run of the task has it, without networks where it needs none.

    Raises:
        InputError: there is no such task.
    """
    usual = task_named(task).usual_policy
    if usual == TOUCH:
        return Condition("optimised", "best", tip_offset=True, touch=True)
    return Condition("optimised", "best") if usual == "optimised" else Condition()


@dataclass(frozen=True)
class EpisodeJob:
    """One episode to run; what a worker process gets."""

    key: str  # of its case
    task: str
    name: str  # of the condition
    condition: Condition
    seed: int
    view: int = -1  # number of the view that is held, -1 the task's own
    way: tuple[tuple[float, ...], ...] = ()  # of the camera arm before the episode starts [rad]
    differs: bool = False  # see `differing_world`
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of the calibration, where it differs [m]
    weights: Path | None = None  # folder of actor and Q, in place of the package's
    residual: Path | None = None  # file, for conditions that have one
    cell: str = DEFAULT_CELL  # that the agent knows
    instance: str = NOMINAL  # what the world's cell is, where it does not differ otherwise
    correction: CellCorrection = NO_CORRECTION  # what is known of that
    max_actions: int = 0  # 0 is the task's limit


def run_episodes(
    log: CaseLog, jobs: Sequence[EpisodeJob], workers: Workers, progress: Progress
) -> list[Case]:
    """Cases of the jobs in their order, each run once and cached; see `run_cases`.

    Episodes of one cell whose agent remembers are one piece of work: a run that was stopped in their midst
    begins the cell again, and what it had found of it stays.
    """
    pieces: dict[tuple[str, ...], list[EpisodeJob]] = {}
    for job in jobs:
        together = (job.task, job.name, job.instance) if job.condition.remembers else (job.key,)
        pieces.setdefault(together, []).append(job)
    work = [(tuple(job.key for job in piece), tuple(piece)) for piece in pieces.values()]
    found = {case["key"]: case for case in run_cases(log, piece_cases, work, workers, progress)}
    return [found[job.key] for job in jobs]


def piece_cases(jobs: tuple[EpisodeJob, ...]) -> list[Case]:
    """Run episodes one after the other; the agent is a new one for the first.

    Raises:
        InputError: from `episode_cases`.
    """
    first, *others = jobs
    cases = episode_cases(first)
    for job in others:
        cases += episode_cases(job, anew=False)
    return cases


def episode_cases(job: EpisodeJob, anew: bool = True) -> list[Case]:
    """Run one episode.

    Every episode has a world of its own, so that it is the same whichever process runs it. `success` and
    `final_error` are truth's, asked when the episode has ended; `believed` is the model's word.

    Args:
        job: what to run.
        anew: whether the agent forgets all episodes before this one.

    Raises:
        InputError: weights that are missing or do not fit.
    """
    residual = job.residual if job.condition.residual else None
    agent = _agent(job.task, job.cell, job.condition, job.weights, residual)
    task, cell = agent.model.task, agent.model.cell
    if anew:
        agent.restart(replace(agent.settings, seed=job.seed), agent.residual, job.correction)
    if job.differs:
        world = differing_world(task, cell, job.offset)
    else:
        world = PyBulletWorld(task, cell, instance=instance_named(job.instance, cell))
    plant = WorldPlant(world, task, cell, correction=job.correction, think_s=job.condition.think_s)
    watch = Stopwatch()
    plant.begin(job.seed)
    for stop in job.way:
        plant.move_camera(np.array(stop))
    limit = job.max_actions or task.max_actions
    views = 0 if job.condition.strategy == HELD else LoopSettings.views_per_search
    # A model that is not updated cannot detect when a task is done.
    loop = LoopSettings(limit, job.condition.view_period, views, stop_on_model_success=job.condition.update)
    began_ns = world.time_ns
    trouble = ""
    try:
        if job.condition.straw_man:
            passed = run_straw_man(job.condition.straw_man, agent, plant, limit, watch)
            ended = "done" if passed else "action_limit"
        else:
            ended = str(run_episode(agent, plant, loop, watch).ended)
    except SamrlError as error:  # out of reach, or a state that some part refuses: this episode has failed
        ended, trouble = "stopped", str(error)
    outcome = evaluate_now(world, task)
    simulated_s = 1e-9 * (world.time_ns - began_ns)
    world.close()
    return [
        {
            "key": job.key,
            "task": job.task,
            "condition": job.name,
            "seed": job.seed,
            "view": job.view,
            "success": outcome.success,
            "believed": ended == "done",
            "why": "" if outcome.success else trouble or ended,
            "final_error": outcome.final_error,
            "peak_force": outcome.peak_force,
            "actions": watch.entered["move"],
            "camera_moves": watch.entered["look"],
            "simulated_s": simulated_s,
            "cpu_s": dict(watch.cpu_s),
            "wall_s": dict(watch.wall_s),
        }
    ]


@cache
def _model(task: str, cell: str) -> Model:
    # One thread: the cores are shared out by processes.
    return Model(task_named(task), cell_named(cell), ModelSettings(threads=1))


@cache
def _agent(task: str, cell: str, condition: Condition, weights: Path | None, residual: Path | None) -> Agent:
    """An agent with all its parts compiled; one model per task serves them all, an episode at a time."""
    model = _model(task, cell)
    strategy = "fixed" if condition.strategy == HELD else condition.strategy
    settings = AgentSettings(
        policy=condition.policy,
        strategy=strategy,
        update=condition.update,
        tip_offset=condition.tip_offset,
        touch=condition.touch,
        doubt=condition.doubt,
        sees_tip=condition.sees_tip,
        sees_colours=condition.sees_colours,
        most_updates=condition.most_updates,
    )
    networks = trained_networks(task, model.cell, weights) if settings.needs_networks else None
    agent = Agent(model, settings, networks)
    if residual is not None:
        agent.residual = announced_residual(residual, sha256_of(residual), task, model.cell)
    agent.prepare()
    return agent
