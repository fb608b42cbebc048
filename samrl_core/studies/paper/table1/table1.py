"""Table I in the model: success rate of the actor by the choice of views.

Every condition has the same starts, and views that the camera arm reaches. Success is `Task.is_done` of the
model's own state, which is the truth in a model. Images are the
model's, clean as in use; a second row varies colours, light and camera noise as in training. Where the folder
of the weights has `seed-1`, `seed-2`, ... each of them is a training of its own.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import OCCLUDED_TASKS, TASKS, task_named
from samrl_core.common.statistics import Share, bootstrap_interval, fisher_p, mcnemar_p
from samrl_core.policy.agent.settings import trained_networks
from samrl_core.policy.view.view_reach import ViewReach, viewpoint_of
from samrl_core.studies.experiment import Case, CaseLog, Experiment, Options, Progress, run_cases
from samrl_core.studies.paper.table1.episodes import (
    CHOICE,
    CONDITIONS,
    TEST,
    Group,
    TableSettings,
    fixed_views,
    run_group,
)
from samrl_core.studies.paper.table1.picture import write_picture

SETTINGS = TableSettings()
MANY = ("active", "best_fixed")  # conditions with all episodes; the others have a share of them
NOISES = {"clean": False, "noisy": True}  # rows


@dataclass(frozen=True)
class Table1Row:
    """One training's networks on one task, under one kind of image."""

    task: str
    weights: Path | None
    noise: str

    def group(self, condition: str, view: int, options: Options, settings: TableSettings) -> Group:
        """A group of no episodes yet."""
        return Group(
            self.task,
            self.weights,
            NOISES[self.noise],
            condition,
            view,
            options.seed,
            TEST,
            0,
            0,
            options.device,
            settings,
            options.cell,
        )


def run_table(options: Options, progress: Progress, settings: TableSettings = SETTINGS) -> dict[str, Any]:
    """All cases that are left, and the summary; see `Experiment.run`.

    Raises:
        InputError: networks are missing or do not fit.
    """
    trainings = _trainings(options.weights)
    for task, weights in itertools.product(options.tasks, trainings):
        trained_networks(task, cell_named(options.cell), weights)  # before anything is run
    rows = [Table1Row(*which) for which in itertools.product(options.tasks, trainings, NOISES)]
    table = _Table(options, progress, settings)
    best = table.best_views(rows)
    results = table.episodes(rows, best)
    summary = {
        "settings": asdict(settings),
        "tasks": {
            task: {
                noise: _summary([r for r in rows if (r.task, r.noise) == (task, noise)], results, table, best)
                for noise in NOISES
            }
            for task in options.tasks
        },
    }
    write_picture(summary["tasks"], options.out / "table1.png")
    return summary


class _Table:
    def __init__(self, options: Options, progress: Progress, settings: TableSettings) -> None:
        self.options, self.settings, self._progress = options, settings, progress
        self._log = CaseLog(options.out)
        self.count = options.count or settings.episodes
        self._views = {
            task: fixed_views(
                ViewReach(cell_named(options.cell), task_named(task), settings.views.reach),
                task,
                options.cell,
            )
            for task in options.tasks
        }

    def best_views(self, rows: Sequence[Table1Row]) -> dict[Table1Row, int]:
        """The fixed view of each row, by most successes and then fewest actions on starts of its own."""
        s, share = self.settings, self.count / self.settings.episodes
        first, more = (max(1, round(share * n)) for n in (s.first, s.more))
        everything = [(row, view) for row in rows for view in range(len(self._views[row.task]))]
        early = self._held(everything, 0, first)
        finalists = []
        for row in rows:
            mine = [(early[row, view], view) for view in range(len(self._views[row.task]))]
            ranked = sorted(mine, key=lambda pair: (_merit(pair[0]), -pair[1]), reverse=True)
            finalists += [(row, view) for _, view in ranked[: s.finalists]]
        late = self._held(finalists, first, more)
        best = {}
        for row in rows:
            merits = {view: _merit([*early[r, view], *late[r, view]]) for r, view in finalists if r == row}
            best[row] = max(merits, key=lambda view: (merits[view], -view))
        return best

    def episodes(
        self, rows: Sequence[Table1Row], best: dict[Table1Row, int]
    ) -> dict[tuple[Table1Row, str], list[Case]]:
        """The table's own."""
        wanted = {}
        for row, condition in itertools.product(rows, CONDITIONS):
            count = self.count
            if condition not in MANY:
                count = max(1, round(self.settings.few_share * count))
            view = best[row] if condition == "best_fixed" else -1
            whole = row.group(condition, view, self.options, self.settings)
            wanted[row, condition] = self._split(replace(whole, count=count))
        return self._run(wanted)

    def viewpoint(self, row: Table1Row, view: int) -> dict[str, float]:
        """Where a fixed view is."""
        region = task_named(row.task).view_region()
        viewpoint = viewpoint_of(self._views[row.task][view].camera_in_world.position, region)
        degrees = np.degrees(viewpoint[:2]).round(1).tolist()
        return {
            "azimuth_deg": degrees[0],
            "elevation_deg": degrees[1],
            "distance_m": round(float(viewpoint[2]), 3),
        }

    def _held(
        self, views: Iterable[tuple[Table1Row, int]], first: int, count: int
    ) -> dict[tuple[Table1Row, int], list[Case]]:
        wanted = {}
        for row, view in views:
            whole = row.group("best_fixed", view, self.options, self.settings)
            wanted[row, view] = self._split(replace(whole, stream=CHOICE, first=first, count=count))
        return self._run(wanted)

    def _split(self, whole: Group) -> list[Group]:
        """Groups of at most `side_by_side` episodes."""
        side, end = self.settings.side_by_side, whole.first + whole.count
        return [replace(whole, first=k, count=min(side, end - k)) for k in range(whole.first, end, side)]

    def _run(self, wanted: dict[Any, list[Group]]) -> dict[Any, list[Case]]:
        jobs = [((group.key,), group) for groups in wanted.values() for group in groups]
        run_cases(self._log, run_group, jobs, self.options.spread, self._progress)
        return {name: [self._log.cases[g.key] for g in groups] for name, groups in wanted.items()}


def _trainings(weights: Path | None) -> list[Path | None]:
    """Folders of networks, one per training seed."""
    if weights is None:
        return [None]
    seeds = sorted(path for path in weights.glob("seed-*") if path.is_dir())
    return list(seeds) or [weights]


def _of(cases: Sequence[Case], name: str) -> list[Any]:
    """A figure of all episodes."""
    return [value for case in cases for value in case[name]]


def _merit(cases: Sequence[Case]) -> tuple[int, float]:
    success, actions = np.array(_of(cases, "success")), np.array(_of(cases, "actions"))
    return int(success.sum()), -float(actions[success].mean()) if success.any() else 0.0


def _summary(
    rows: Sequence[Table1Row],
    results: dict[tuple[Table1Row, str], list[Case]],
    table: _Table,
    best: dict[Table1Row, int],
) -> dict[str, Any]:
    """Of all trainings on one task."""
    conditions = {}
    for name in CONDITIONS:
        cases = [case for row in rows for case in results[row, name]]
        success, actions = np.array(_of(cases, "success")), np.array(_of(cases, "actions"))
        conditions[name] = {
            "success": Share.of(success.tolist()).as_dict(),
            "per_training": [float(np.mean(_of(results[row, name], "success"))) for row in rows],
            "median_actions_of_successes": float(np.median(actions[success])) if success.any() else None,
            "median_actions": float(np.median(actions)),
            "camera_s_per_episode": float(np.mean(_of(cases, "camera_s"))),
        }
    active, fixed = (
        [bool(x) for row in rows for x in _of(results[row, name], "success")]
        for name in ("active", "best_fixed")
    )
    pairs = list(zip(active, fixed, strict=True))

    def difference(some: Sequence[tuple[bool, bool]]) -> float:
        return float(np.mean([int(a) - int(b) for a, b in some]))

    rng = np.random.default_rng(table.options.seed)
    return {
        "conditions": conditions,
        "best_fixed_view": [table.viewpoint(row, best[row]) for row in rows],
        "active_against_best_fixed": {
            "difference": difference(pairs),
            "difference_ci95": bootstrap_interval(pairs, difference, rng),
            "p_paired": mcnemar_p(active, fixed),
            "p_fisher": fisher_p(sum(active), len(active), sum(fixed), len(fixed)),
        },
    }


EXPERIMENT = Experiment(
    "table1",
    "success in the model by the choice of views (Table I), with occluded variants",
    (*TASKS, *OCCLUDED_TASKS),
    run_table,
)
