"""Which pixels actor and Q go by (the paper's Fig. 7).

Slopes of actor and Q by the image, averaged over the camera's noise, in states of an expert's episode from
random views. How much more of them lies in the object than its area would have is their energy's share over
the area's. Covering parts of the image checks whether the gradients are meaningful: both maps should agree.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.cell.tasks import TASKS
from samrl_core.common.statistics import pooled_median
from samrl_core.policy.view.views import ViewSettings, sample_views
from samrl_core.studies.experiment import Case, CaseLog, Experiment, Options, Progress, run_cases
from samrl_core.studies.paper.expert_states import PHASES, expert_states
from samrl_core.studies.paper.fig7_picture import write_picture
from samrl_core.studies.paper.saliency import NETWORKS, Examined, SaliencySettings, examine, within_patches
from samrl_core.studies.paper.view_bench import spread, view_bench
from samrl_core.studies.paper.view_maps import rank_correlation

COUNT = 20  # episodes per task
VIEWS = 4  # of each state
LEAST_PIXELS = 30  # of a mask; smaller ones are hidden
MASKS = ("target", "objects")
SHOWN = 1  # the phase of the picture


@dataclass(frozen=True)
class Fig7Job:
    """One episode of one task."""

    task: str
    cell: str
    seed: int
    device: str
    weights: Path | None
    views: int
    settings: SaliencySettings


def run_job(job: Fig7Job) -> list[Case]:
    """Figures of one episode's states, one value per view and network."""
    cases = []
    for phase, examined in zip(PHASES, _episode(job, PHASES), strict=True):
        case: Case = {
            "key": _key(job.task, job.seed, phase),
            "task": job.task,
            "seed": job.seed,
            "phase": phase,
        }
        case |= {f"{name}_area": getattr(examined, name).mean(axis=(1, 2)).tolist() for name in MASKS}
        for network in NETWORKS:
            case[network] = _metrics_of(examined, network, job.settings)
        cases.append(case)
    return cases


def run(
    options: Options, progress: Progress, views: int = VIEWS, settings: SaliencySettings | None = None
) -> dict[str, Any]:
    """All episodes; the summary by task and network."""
    count, s = options.count or COUNT, settings or SaliencySettings()
    jobs = [
        (
            [_key(task, seed, phase) for phase in PHASES],
            Fig7Job(task, options.cell, seed, options.device, options.weights, views, s),
        )
        for task in options.tasks
        for seed in range(options.seed, options.seed + count)
    ]
    cases = run_cases(CaseLog(options.out), run_job, jobs, spread(options), progress)
    summary: dict[str, Any] = {"episodes": count, "views_of_each_state": views, "tasks": {}}
    shown = {}
    for task in options.tasks:
        of_task = [case for case in cases if case["task"] == task]
        summary["tasks"][task] = {name: _summary(of_task, name, options.seed) for name in NETWORKS}
        job = Fig7Job(task, options.cell, options.seed, options.device, options.weights, 1, s)
        shown[task] = _episode(job, PHASES[SHOWN : SHOWN + 1])[0]
    write_picture(options.out / "fig7.png", shown, summary["tasks"], s)
    return summary


def _key(task: str, seed: int, phase: float) -> str:
    return f"{task}/{seed}/{phase}"


def _episode(job: Fig7Job, phases: tuple[float, ...]) -> list[Examined]:
    bench = view_bench(job.task, job.cell, job.device, job.weights)
    model = bench.renderer.model
    found = []
    for number, state in enumerate(expert_states(model, job.seed, phases)):
        rng = np.random.default_rng([job.seed, 7, number])
        views = sample_views(model.task.view_region(), rng, job.views, ViewSettings(look_jitter=0.0))
        found.append(examine(bench.renderer, bench.networks, state, views, job.seed, job.settings))
    return found


def _metrics_of(examined: Examined, network: str, settings: SaliencySettings) -> dict[str, list[float]]:
    """Per view: share of the gradients' energy within each mask, and how well covering agrees."""
    gradients, covered = examined.gradients[network], examined.covered[network]
    whole = np.maximum(gradients.sum(axis=(1, 2)), np.finfo(float).tiny)
    found = {
        f"{name}_energy": ((gradients * getattr(examined, name)).sum(axis=(1, 2)) / whole).tolist()
        for name in MASKS
    }
    means = within_patches(gradients, settings)
    pairs = zip(means, covered, strict=True)
    found["covering"] = [rank_correlation(gradient.ravel(), change.ravel()) for gradient, change in pairs]
    return found


def _summary(cases: list[Case], network: str, seed: int) -> dict[str, Any]:
    """Medians over views with intervals over episodes."""
    episodes = sorted({case["seed"] for case in cases})
    least = LEAST_PIXELS / 128**2
    found: dict[str, Any] = {}

    def add(name: str, values: dict[int, list[float]]) -> None:
        middle, interval = pooled_median(values, np.random.default_rng([seed, 77]))
        count = sum(len(some) for some in values.values())
        found[name] = {"median": middle, "interval95": list(interval), "views": count}

    for mask in MASKS:
        ratios: dict[int, list[float]] = {episode: [] for episode in episodes}
        shares: dict[int, list[float]] = {episode: [] for episode in episodes}
        for case in cases:
            for energy, area in zip(case[network][f"{mask}_energy"], case[f"{mask}_area"], strict=True):
                if area >= least:
                    ratios[case["seed"]].append(energy / area)
                    shares[case["seed"]].append(energy)
        add(f"{mask}_energy_over_area", ratios)
        add(f"{mask}_energy", shares)
    agreement = {
        e: [v for case in cases if case["seed"] == e for v in case[network]["covering"]] for e in episodes
    }
    add("covering_agrees", agreement)
    return found


EXPERIMENT = Experiment(
    "fig7", "which pixels actor and Q go by, against the object's mask", tuple(TASKS), run
)
