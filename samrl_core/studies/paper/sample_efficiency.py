"""How many real steps the residual needs (SAM-RL, section IV-C): success in a world that differs.

Per task and training seed, episodes of the agent in a PyBullet world that its model does not know fill a
replay, and TD3 trains the residual on it (eqs. 13 to 16). The model's own verdict is the reward. At each
point of the curve, the first one before any real step, the weights are saved and evaluated by the truth on
episodes of other scenes; these explore nothing, are not learnt from and not counted as steps. `count` is the
number of real steps. How far the calibration is off in that world is found first, see `calibration_gap`.
"""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from samrl_core.cell.tasks import TASKS
from samrl_core.policy.networks.weights import weights_file
from samrl_core.studies.episodes.residual_episodes import EpisodeSite
from samrl_core.studies.experiment import CaseLog, Experiment, Options, Progress
from samrl_core.studies.paper.calibration_gap import gaps, offset_of
from samrl_core.studies.paper.residual_evaluation import RunSettings
from samrl_core.studies.paper.residual_trainings import TrainingJob, player_of, train_all
from samrl_core.studies.paper.sample_efficiency_curve import summary_of, write_picture

NAME = "sample_efficiency"
SEEDS = 3  # trainings per task
BUDGET = 8000  # real steps
POINTS = (0, 500, 1000, 2000, 4000, 8000)


def points_up_to(budget: int) -> tuple[int, ...]:
    """Where the curve is evaluated, the budget included."""
    return (*(p for p in POINTS if p < budget), budget)


def policy_for(task: str, weights: Path | None) -> str:
    """The nominal policy: the learned one where it has been trained, else the planner's."""
    return "learned" if weights_file(task, "sim_actor", weights).is_file() else "optimised"


def run(options: Options, progress: Progress) -> dict[str, Any]:
    """The gap, then all runs side by side; see the module."""
    points = points_up_to(options.count or BUDGET)
    log = CaseLog(options.out)
    calibrated = [
        EpisodeSite(t, policy_for(t, options.weights), options.weights, (0.0, 0.0, 0.0), options.cell)
        for t in options.tasks
    ]
    for site in calibrated:
        progress(f"{site.task}: nominal actions are {site.policy}")
    with player_of(options) as player:
        found = gaps(log, calibrated, player, progress, options.processes)
        sites = [replace(p, offset=offset_of(found[p.task]["length"])) for p in calibrated]
        jobs = [
            TrainingJob(site, options.seed + k, RunSettings(points, max_actions=site.max_actions))
            for k in range(SEEDS)
            for site in sites
        ]
        train_all(jobs, options, log, player, progress)
    cases = [log.cases[job.key(n)] for job in jobs for n in points]
    summary = {
        "settings": asdict(jobs[0].settings),
        "gap": found,
        "tasks": {t: summary_of([c for c in cases if c["task"] == t]) for t in options.tasks},
        "cases": cases,
    }
    write_picture(summary["tasks"], options.out / f"{NAME}.png")
    return summary


EXPERIMENT = Experiment(
    NAME,
    "success over real steps of the residual, in a world that differs",
    tuple(TASKS),
    run,
    one_machine=True,
)
