"""Q and the actor's action error over the camera's azimuth and elevation (the paper's Fig. 6).

States are those of an expert's episode in the model at three phases. In each, actor and Q are asked from a
grid of views at the region's middle distance, of clean images and of images with the camera's noise. Whether
Q knows where the actor sees well is measured by Spearman's correlation of Q and the error's negative over the
grid, state by state, and by what the view of highest Q loses against the grid's best.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.cell.tasks import OCCLUDED_TASKS, TASKS
from samrl_core.common.statistics import pooled_median
from samrl_core.learning.images.batch_render import model_of
from samrl_core.studies.experiment import Case, CaseLog, Experiment, Options, Progress, run_cases
from samrl_core.studies.paper.expert_states import PHASES, expert_states
from samrl_core.studies.paper.fig6_picture import write_picture
from samrl_core.studies.paper.view_bench import spread, view_bench
from samrl_core.studies.paper.view_maps import (
    DRAWS,
    rank_correlation,
    reachable,
    regret,
    view_grid,
    view_maps,
)

COUNT = 20  # episodes per task
MAPS = ("q", "error", "noisy_q", "noisy_error")
# What is correlated: which Q with which error. Q of the clean image is what the view is chosen by; the error
# under noise is what a camera of such noise would bring.
PAIRS = {
    "clean": ("q", "error"),
    "noisy": ("noisy_q", "noisy_error"),
    "clean_q_noisy_error": ("q", "noisy_error"),
}


@dataclass(frozen=True)
class Fig6Job:
    """One episode of one task."""

    task: str
    cell: str
    seed: int
    device: str
    weights: Path | None
    noise_samples: int
    size: tuple[int, int]  # azimuths and elevations


def keys_of(task: str, seed: int) -> list[str]:
    """Of the cases of one episode."""
    return [f"{task}/{seed}/{phase}" for phase in PHASES]


def run_job(job: Fig6Job) -> list[Case]:
    """Maps and metrics of one episode's states."""
    bench = view_bench(job.task, job.cell, job.device, job.weights)
    model = bench.renderer.model
    grid = view_grid(model.task.view_region(), *job.size)
    cases: list[Case] = []
    for key, state in zip(keys_of(job.task, job.seed), expert_states(model, job.seed), strict=True):
        maps = view_maps(bench.renderer, bench.networks, state, grid.views, job.seed, job.noise_samples)
        case: Case = {"key": key, "task": job.task, "seed": job.seed, "phase": state.phase}
        case |= {"step": state.step, "sub_goal": state.sub_goal, "error_mm": float(1e3 * maps.error.mean())}
        pairs = {name: [getattr(maps, which) for which in pair] for name, pair in PAIRS.items()}
        case["spearman"] = {name: rank_correlation(q, -error) for name, (q, error) in pairs.items()}
        regrets = {name: regret(*pair) for name, pair in pairs.items()}
        case["regret"] = {name: of_best for name, (of_best, _) in regrets.items()}
        case["regret_of_random"] = {name: of_random for name, (_, of_random) in regrets.items()}
        cases.append(case | {name: getattr(maps, name).astype(np.float32).tolist() for name in MAPS})
    return cases


def run(
    options: Options, progress: Progress, noise_samples: int = DRAWS, size: tuple[int, int] = (24, 9)
) -> dict[str, Any]:
    """All episodes; the summary by task and phase."""
    count = options.count or COUNT
    jobs = [
        (
            keys_of(task, seed),
            Fig6Job(task, options.cell, seed, options.device, options.weights, noise_samples, size),
        )
        for task in options.tasks
        for seed in range(options.seed, options.seed + count)
    ]
    cases = run_cases(CaseLog(options.out), run_job, jobs, spread(options), progress)
    summary: dict[str, Any] = {
        "episodes": count,
        "draws_of_noise": noise_samples,
        "grid": list(size),
        "tasks": {},
    }
    reached = {}
    for task in options.tasks:
        model = model_of(task, options.cell)
        reached[task] = reachable(model, view_grid(model.task.view_region(), *size))
        of_task = [case for case in cases if case["task"] == task]
        summary["tasks"][task] = _summary(of_task, reached[task], options.seed)
    write_picture(options.out / "fig6.png", cases, reached, size, summary["tasks"])
    return summary


def _summary(cases: list[Case], reached: np.ndarray, seed: int) -> dict[str, Any]:
    """Medians with intervals over episodes, by phase and over all."""
    found: dict[str, Any] = {"reachable_views": float(reached.mean())}
    for phase in ("all", *PHASES):
        of_phase = [case for case in cases if phase in ("all", case["phase"])]
        found[str(phase)] = _metrics_of(of_phase, reached, seed)
    return found


def _metrics_of(cases: list[Case], reached: np.ndarray, seed: int) -> dict[str, Any]:
    found: dict[str, Any] = {"states": len(cases)}
    episodes = sorted({case["seed"] for case in cases})

    def median(kind: str, pair: str) -> dict[str, Any]:
        by = {e: [case[kind][pair] for case in cases if case["seed"] == e] for e in episodes}
        middle, interval = pooled_median(by, np.random.default_rng([seed, 66]))
        return {"median": middle, "interval95": list(interval)}

    for kind in ("spearman", "regret", "regret_of_random"):
        found[kind] = {pair: median(kind, pair) for pair in PAIRS}
    columns = {name: np.array([case[name] for case in cases]) for name in MAPS}
    found["error_mm"] = float(1e3 * columns["error"].mean())
    found["noisy_error_mm"] = float(1e3 * columns["noisy_error"].mean())
    # What is common to all states of a phase: which views are good on the whole.
    found["spearman_of_means"], found["spearman_where_reachable"] = {}, {}
    for name, (q, error) in PAIRS.items():
        found["spearman_of_means"][name] = rank_correlation(columns[q].mean(0), -columns[error].mean(0))
        if reached.sum() > 1:
            pairs = zip(columns[q], columns[error], strict=True)
            each = [rank_correlation(a[reached], -b[reached]) for a, b in pairs]
            found["spearman_where_reachable"][name] = float(np.median(each))
    found["alike_from_state_to_state"] = _alike(columns["error"])
    return found


def _alike(maps: np.ndarray) -> float:
    """Median rank correlation of the error maps of two states."""
    pairs = [rank_correlation(maps[i], maps[j]) for i in range(len(maps)) for j in range(i)]
    return float(np.median(pairs)) if pairs else 1.0


EXPERIMENT = Experiment(
    "fig6",
    "Q and action error over the camera's azimuth and elevation",
    tuple(TASKS),
    run,
    on_request=tuple(OCCLUDED_TASKS),
)
