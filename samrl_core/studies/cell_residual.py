"""What a residual is worth in one cell that nobody calibrated: learnt from real episodes there.

Of the first cells those are taken in which the loop without a residual succeeds at times: elsewhere there
is nothing to gain, or no reward to learn from. Each trains a residual of its own (eqs. 13 to 16); at each
point of its curve, the first one before any step, the weights are evaluated on the same episodes, without
exploration. A touched peg is led without a residual, so there is none to learn. `count` is the number of real
steps per cell, `seed` the number of the first cell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from samrl_core.cell.instance.cell_instance import InstanceName
from samrl_core.cell.tasks import task_named
from samrl_core.common.statistics import Share, mcnemar_p
from samrl_core.common.streams import DEVELOPMENT, TEST, seed_of
from samrl_core.learning.residual.td3 import TD3Settings
from samrl_core.studies.episodes.residual_episodes import EpisodeSite, Order, Play
from samrl_core.studies.experiment import Case, CaseLog, Experiment, Options, Progress
from samrl_core.studies.paper.residual_evaluation import RunSettings
from samrl_core.studies.paper.residual_trainings import TrainingJob, player_of, train_all
from samrl_core.studies.paper.sample_efficiency_curve import summary_of, write_picture
from samrl_core.studies.purpose import keep_purpose, one_purpose

NAME = "cell_residual"
LEVEL = "careless"
CANDIDATES = 8  # cells, in the order of their numbers
SCREENED = 4  # episodes in each of them
CELLS = 2  # that a residual is learnt in, at most
BUDGET = 4000  # real steps in each of these
POINTS = (0, 2000)  # evaluated besides the last one
PURPOSES = {LEVEL: DEVELOPMENT, f"{LEVEL}_test": TEST}  # by the condition's name


def run(options: Options, progress: Progress) -> dict[str, Any]:
    """The cells, then all trainings side by side; see the module.

    Raises:
        InputError: conditions for development and for a final table in one folder.
    """
    purpose = one_purpose(PURPOSES[name] for name in options.conditions or (LEVEL,))
    keep_purpose(options.out, purpose)
    budget = options.count or BUDGET
    points = (*(p for p in POINTS if p < budget), budget)
    log = CaseLog(options.out)
    sites = {
        task: [_site(options, task, purpose, options.seed + k) for k in range(CANDIDATES)]
        for task in options.tasks
    }
    with player_of(options) as player:
        screened = {task: _screened(log, some, player, purpose) for task, some in sites.items()}
        jobs = []
        for task, some in sites.items():
            taken = cells_to_learn_in([screened[task][site.instance] for site in some])
            progress(f"{task}: learns in {', '.join(some[k].instance for k in taken) or 'no cell'}")
            for k in taken:
                settings = RunSettings(points, max_actions=some[k].max_actions)
                jobs.append(TrainingJob(some[k], options.seed + k, settings))
        train_all(jobs, options, log, player, progress)
    cases = {job: [log.cases[job.key(n)] for n in points] for job in jobs}
    curves = {f"{job.site.task} {job.site.instance}": summary_of(some) for job, some in cases.items()}
    if curves:
        write_picture(curves, options.out / f"{NAME}.png")
    return {
        "purpose": purpose,
        "screened": {
            task: {name: Share.of(some).as_dict() for name, some in found.items()}
            for task, found in screened.items()
        },
        "settings": asdict(jobs[0].settings) if jobs else {},
        "cells": curves,
        "gain": {
            task: gain_of([some for job, some in cases.items() if job.site.task == task])
            for task in options.tasks
        },
        "cases": [case for some in cases.values() for case in some],
    }


def cells_to_learn_in(successes: Sequence[Sequence[bool]]) -> list[int]:
    """Numbers of the first cells with some successes and some failures."""
    return [k for k, some in enumerate(successes) if 0 < sum(some) < len(some)][:CELLS]


def gain_of(cells: Sequence[Sequence[Case]]) -> dict[str, Any]:
    """The last point against the first one, on the episodes of all cells, in pairs.

    Args:
        cells: cases per cell, in the order of their points.

    Returns:
        "before" and "after": shares; "won" and "lost": pairs; "p": McNemar's, one-sided.
    """
    before = [one for some in cells for one in some[0]["outcomes"]]
    after = [one for some in cells for one in some[-1]["outcomes"]]
    pairs = list(zip(before, after, strict=True))
    return {
        "before": Share.of(before).as_dict(),
        "after": Share.of(after).as_dict(),
        "won": sum(b and not a for a, b in pairs),
        "lost": sum(a and not b for a, b in pairs),
        "p": mcnemar_p(after, before),
    }


def _site(options: Options, task: str, purpose: str, number: int) -> EpisodeSite:
    policy = task_named(task).usual_policy
    instance = str(InstanceName(LEVEL, number, purpose))
    return EpisodeSite(task, policy, options.weights, (0.0, 0.0, 0.0), options.cell, instance)


def _screened(log: CaseLog, sites: Sequence[EpisodeSite], play: Play, purpose: str) -> dict[str, list[bool]]:
    """Successes of the loop without a residual, by cell."""
    for site in sites:  # one after another: what an interruption costs is one cell's
        left = [k for k in range(SCREENED) if _key(site, k) not in log.cases]
        for k, played in zip(left, play([_screening(site, k, purpose) for k in left]), strict=True):
            log.keep(
                {
                    "key": _key(site, k),
                    "task": site.task,
                    "success": played.success,
                    "detected": played.ended == "done",
                    "actions": len(played.steps),
                    "final_error": played.final_error,
                    "why": played.why,
                }
            )
    return {
        site.instance: [bool(log.cases[_key(site, k)]["success"]) for k in range(SCREENED)] for site in sites
    }


def _key(site: EpisodeSite, number: int) -> str:
    return f"screening/{site.name}/{number}"


def _screening(site: EpisodeSite, number: int, purpose: str) -> Order:
    seed = seed_of(number, "screening for a residual", purpose, site.name)
    return Order(site, seed, site.max_actions, {}, TD3Settings().limit)


EXPERIMENT = Experiment(
    NAME,
    "success over real steps of a residual that is learnt in one careless cell",
    ("spatula_flipping_hard", "needle_threading_hard"),
    run,
    conditions=tuple(PURPOSES),
    one_machine=True,
)
