"""Trainings of residuals side by side, and the evaluation of each at the points of its curve.

Episodes of all runs share the worker processes; the learners are threads of this process and update on
`device`, so that one accelerator serves them all. Saved weights are evaluated while the training goes on: its
rounds are small at first and leave processes idle.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, as_completed, wait
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import torch

from samrl_core.cell.robots.cells import cell_named
from samrl_core.common.executor import worker_pool
from samrl_core.learning.residual.transitions import nominal_encoder
from samrl_core.policy.networks.weights import weights_name
from samrl_core.studies.episodes.residual_episodes import EpisodeSite, Order, Play, Played, play
from samrl_core.studies.experiment import Case, CaseLog, Options, Progress
from samrl_core.studies.paper.residual_evaluation import RunSettings, evaluated_file
from samrl_core.studies.paper.residual_run import ResidualRun

_ALONE = threading.Lock()  # around what this process keeps for its episodes
_ASKED_S = 0.5  # so often it is looked whether to stop


@dataclass(frozen=True)
class TrainingJob:
    """One training."""

    site: EpisodeSite
    seed: int
    settings: RunSettings

    def key(self, point: int) -> str:
        """Of its case at a point of the curve."""
        return f"{self.site.name}/{self.seed}/{point}"

    def weights_at(self, out: Path, point: int) -> Path:
        """Where an experiment's folder keeps the residual as it was at a point of the curve."""
        return weights_at(out / self.site.instance.replace(":", "-"), self.site.task, self.seed, point)


class Stopped(Exception):
    """Episodes were asked for after the player was told to stop, or were not played to their end."""


class Player:
    """Plays episodes in a pool's processes, or in this one, until it is told to stop.

    Args:
        pool: of worker processes; None: episodes are played here, one after another.
        starter: submits to it. A worker ends with the thread that started it, so one that outlives all others
            starts them.
    """

    def __init__(self, pool: Executor | None = None, starter: Executor | None = None) -> None:
        self._pool, self._starter = pool, starter
        self.stop = threading.Event()

    def __call__(self, orders: Sequence[Order]) -> list[Played]:
        """Episodes in the order that was asked for.

        Raises:
            Stopped: before the last of them was played.
        """
        pool, starter = self._pool, self._starter
        if pool is None or starter is None:
            return [self._here(order) for order in orders]
        futures = starter.submit(_submit_all, pool, orders).result()
        pending = set(futures)
        while pending:
            if self.stop.is_set():
                for future in pending:
                    future.cancel()
                raise Stopped
            done, pending = wait(pending, timeout=_ASKED_S, return_when=FIRST_COMPLETED)
            for future in done:
                future.result()  # the first error ends the rest
        return [future.result() for future in futures]

    def _here(self, order: Order) -> Played:
        if self.stop.is_set():
            raise Stopped
        with _ALONE:
            return play(order)


def _submit_all(pool: Executor, orders: Sequence[Order]) -> list[Future[Played]]:
    return [pool.submit(play, order) for order in orders]


@contextmanager
def player_of(options: Options) -> Generator[Player]:
    """Of as many processes as there shall be."""
    if options.processes == 1:
        yield Player()
        return
    with ThreadPoolExecutor(1) as starter, worker_pool(options.processes) as pool:
        yield Player(pool, starter)


def train_all(
    jobs: Sequence[TrainingJob], options: Options, log: CaseLog, player: Player, progress: Progress
) -> None:
    """Every job's points as cases of the log; what is there already is not done again.

    Args:
        jobs: no two of one site and seed.
        options: of the experiment; its folder keeps runs and weights.
        log: keeps the cases.
        player: is told to stop at the end, so that an interrupt waits for no episode.
        progress: called with each point's success.

    Raises:
        SolveError: a learner's loss or gradient is not finite; see `ResidualRun.advance`.
    """
    jobs = [job for job in jobs if any(job.key(n) not in log.cases for n in job.settings.points)]
    if not jobs:
        return
    lock, stop = threading.Lock(), player.stop

    def keep(case: Case) -> None:
        with lock:
            log.keep(case)
            rate = case["successes"] / case["evaluated"]
            progress(f"{case['key']}: success {rate:.2f} after {case['steps']} real steps")

    torch.set_num_threads(max(1, options.processes // len(jobs)))
    with (
        ThreadPoolExecutor(len(jobs)) as evaluators,
        ThreadPoolExecutor(len(jobs)) as threads,
        ExitStack() as last,
    ):
        last.callback(stop.set)  # before the threads are waited for: they end with their round
        evaluations: list[Future[None]] = []

        def evaluate(job: TrainingJob, point: int) -> None:
            with suppress(Stopped):
                keep(evaluate_at(job, point, options.out, player))

        def on_saved(job: TrainingJob, point: int) -> None:
            if job.key(point) not in log.cases:
                evaluations.append(evaluators.submit(evaluate, job, point))

        runs = [threads.submit(_train, job, options, player, on_saved) for job in jobs]
        for one in as_completed(runs):
            one.result()
        for other in as_completed(evaluations):
            other.result()


def _train(
    job: TrainingJob,
    options: Options,
    player: Player,
    on_saved: Callable[[TrainingJob, int], None],
) -> None:
    """One training from where it was left; `on_saved` is called with each point whose weights are saved."""
    folder = options.out / "runs" / f"{job.site.name}-{job.seed}"
    cell = cell_named(job.site.cell)
    encoder = nominal_encoder(job.site.task, cell, job.site.weights)
    run = ResidualRun(folder, job.site, cell, encoder, job.seed, job.settings, player, options.device)
    try:
        for point in job.settings.points:
            run.advance(point, lambda: not player.stop.is_set())
            if player.stop.is_set():
                return
            file = job.weights_at(options.out, point)
            if not file.is_file():
                run.save_weights(file)
            on_saved(job, point)
    except Stopped:
        return
    finally:
        run.close()


def weights_at(out: Path, task: str, seed: int, point: int) -> Path:
    """Where an experiment keeps the residual of a run as it was at a point of the curve."""
    return out / "weights" / f"seed_{seed}" / f"steps_{point}" / weights_name(task, "residual_actor")


def evaluate_at(job: TrainingJob, point: int, out: Path, player: Play) -> Case:
    """Evaluates the weights saved at a point, by the truth.

    Raises:
        InputError: their file does not fit; see `load_weights`.
    """
    task = job.site.task
    file = job.weights_at(out, point)
    cell = cell_named(job.site.cell)
    found, info = evaluated_file(player, job.site, job.seed, job.settings, file, cell)
    return {
        "key": job.key(point),
        "task": task,
        "policy": job.site.policy,
        "seed": job.seed,
        "point": point,
        "steps": int(info.figures["steps"]),
        "episodes": int(info.figures["episodes"]),
        "updates": int(info.figures["updates"]),
        "evaluated": len(found.successes),
        "successes": sum(found.successes),
        "outcomes": found.successes,
        "detected": sum(found.detected),
        "false_detections": sum(d and not s for d, s in zip(found.detected, found.successes, strict=True)),
        "final_error": sum(found.final_errors) / len(found.final_errors),
        "actions": sum(found.actions) / len(found.actions),
        "residual": found.residual,
        "errors": found.errors,
    }
