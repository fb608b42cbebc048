"""How many real steps the residual needs (SAM-RL, section IV-C): success in a world that differs.

Per task and training seed, episodes of the agent in a PyBullet world that its model does not know fill a
replay, and TD3 trains the residual on it (eqs. 13 to 16). The model's own verdict is the reward. At each
point of the curve, the first one before any real step, episodes of other scenes are judged by the truth;
they explore nothing, are not learnt from and not counted as steps. `count` is the number of real steps. How
far the calibration is off in that world is found first, see `calibration_gap`.

Episodes of all runs share the worker processes; the learners are threads of this process and update on
`device`, so that one accelerator serves them all.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor, as_completed
from contextlib import ExitStack
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import torch

from samrl_core.experiments.calibration_gap import gaps, offset_of
from samrl_core.experiments.experiment import Case, CaseLog, Experiment, Options, Tell
from samrl_core.experiments.residual_episodes import Order, Place, Play, Played, play
from samrl_core.experiments.residual_run import Evaluated, ResidualRun, RunSettings
from samrl_core.experiments.sample_efficiency_curve import summary_of, write_picture
from samrl_core.learn.weights import shipped
from samrl_core.learn.workers import worker_pool
from samrl_core.robots.cell import default_cell
from samrl_core.tasks import TASKS

NAME = "sample_efficiency"
SEEDS = 3  # trainings per task
BUDGET = 8000  # real steps
POINTS = (0, 250, 500, 1000, 2000, 4000, 8000)


def points_up_to(budget: int) -> tuple[int, ...]:
    """Where the curve is evaluated, the budget included."""
    return (*(p for p in POINTS if p < budget), budget)


def policy_for(task: str, weights: Path | None) -> str:
    """The nominal policy: the learned one where it has been trained, else the planner's."""
    file = shipped(task, "sim_actor")
    return "learned" if ((weights / file.name) if weights else file).is_file() else "optimised"


def run(options: Options, tell: Tell) -> dict[str, Any]:
    """All runs side by side; see the module."""
    budget = options.count or BUDGET
    settings = RunSettings(points_up_to(budget))
    log = CaseLog(options.out)
    calibrated = [
        Place(t, policy_for(t, options.weights), options.weights, (0.0, 0.0, 0.0)) for t in options.tasks
    ]
    for place in calibrated:
        tell(f"{place.task}: nominal actions are {place.policy}")
    found = gaps(log, calibrated, options.processes, tell)
    places = [replace(p, offset=offset_of(found[p.task]["length"])) for p in calibrated]
    jobs = [(place, options.seed + k) for k in range(SEEDS) for place in places]
    left = [(p, s) for p, s in jobs if any(_key(p, s, n) not in log.cases for n in settings.points)]
    _run_all(left, settings, options, log, tell)
    cases = [log.cases[_key(place, seed, n)] for place, seed in jobs for n in settings.points]
    summary = {
        "settings": asdict(settings),
        "gap": found,
        "tasks": {t: summary_of([c for c in cases if c["task"] == t]) for t in options.tasks},
        "cases": cases,
    }
    write_picture(summary["tasks"], options.out / f"{NAME}.png")
    return summary


def _run_all(
    jobs: Sequence[tuple[Place, int]], settings: RunSettings, options: Options, log: CaseLog, tell: Tell
) -> None:
    if not jobs:
        return
    lock, stop = threading.Lock(), threading.Event()

    def keep(case: Case) -> None:
        with lock:
            log.keep(case)
            rate = case["successes"] / case["evaluated"]
            tell(f"{case['key']}: success {rate:.2f} after {case['steps']} real steps")

    torch.set_num_threads(max(1, options.processes // len(jobs)))
    with ExitStack() as stack:
        player: Play = _here
        if options.processes > 1:
            # A worker ends with the thread that started it, so one that outlives the runs starts them all.
            starter = stack.enter_context(ThreadPoolExecutor(1))
            player = _spread(stack.enter_context(worker_pool(options.processes)), starter)
        threads = stack.enter_context(ThreadPoolExecutor(len(jobs)))
        stack.callback(stop.set)  # before the threads are waited for: they end with their round
        runs = [threads.submit(_one, *job, settings, options, log, player, keep, stop) for job in jobs]
        for one in as_completed(runs):
            one.result()


def _one(
    place: Place,
    seed: int,
    settings: RunSettings,
    options: Options,
    log: CaseLog,
    player: Play,
    keep: Callable[[Case], None],
    stop: threading.Event,
) -> None:
    """One training from where it was left."""
    folder = options.out / "runs" / f"{place.task}-{seed}"
    residual = ResidualRun(folder, place, default_cell(), seed, settings, player, options.device)
    try:
        for point in settings.points:
            residual.advance(point, lambda: not stop.is_set())
            if stop.is_set():
                return
            if _key(place, seed, point) not in log.cases:
                case = _case(place, seed, point, residual.evaluate())
                name = shipped(place.task, "residual_actor").name
                rate = case["successes"] / case["evaluated"]
                residual.save_weights(options.out / "weights" / f"seed_{seed}" / name, {"success": rate})
                keep(case)
    finally:
        residual.close()


def _here(orders: Sequence[Order]) -> list[Played]:
    return [play(order) for order in orders]


def _spread(pool: Executor, starter: Executor) -> Play:
    def played(orders: Sequence[Order]) -> list[Played]:
        futures = starter.submit(lambda: [pool.submit(play, order) for order in orders]).result()
        return [future.result() for future in futures]

    return played


def _key(place: Place, seed: int, point: int) -> str:
    return f"{place.task}/{seed}/{point}"


def _case(place: Place, seed: int, point: int, found: Evaluated) -> Case:
    return {
        "key": _key(place, seed, point),
        "task": place.task,
        "policy": place.policy,
        "seed": seed,
        "point": point,
        "steps": found.steps,
        "episodes": found.episodes,
        "updates": found.updates,
        "evaluated": len(found.successes),
        "successes": sum(found.successes),
        "detected": sum(found.detected),
        "false_detections": sum(d and not s for d, s in zip(found.detected, found.successes, strict=True)),
        "final_error": sum(found.final_errors) / len(found.final_errors),
        "actions": sum(found.actions) / len(found.actions),
        "residual": found.residual,
        "errors": found.errors,
    }


EXPERIMENT = Experiment(
    NAME, "success over real steps of the residual, in a world that differs", tuple(TASKS), run
)
