"""Success against the size of each group of a cell's differences, one group at a time.

It tells whoever installs a cell which of its tolerances matters for a task. Every episode has a cell of its
own, and the same episodes are run at every size: a point differs from the next by the group's scale alone,
and is compared with the typical one in pairs.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from samrl_core.cell.instance.cell_instance import GROUPS, InstanceName
from samrl_core.cell.tasks import EVERY_TASK
from samrl_core.common.figure_file import save_figure
from samrl_core.common.streams import DEVELOPMENT, seed_of
from samrl_core.studies.episodes.success_rates import compared, rates
from samrl_core.studies.episodes.world_episodes import EpisodeJob, run_episodes, usual_condition
from samrl_core.studies.experiment import Case, CaseLog, Experiment, Options, Progress
from samrl_core.studies.purpose import keep_purpose

NAME = "cell_sensitivity"
COUNT = 20  # episodes per point
FIRST_CELL = 100  # development cells from here on: none that anything was tuned in
SCALES = (4.0, 2.0, 0.5)  # times typical; what is likelier to fail comes first
TYPICAL = "typical"  # every group at its typical size: the point at 1 of every curve
POINTS: dict[str, tuple[str, float]] = {  # group and scale by the condition's name
    TYPICAL: ("", 1.0),
    **{f"{group}_x{scale:g}": (group, scale) for scale in SCALES for group in GROUPS},
}
DEFAULT = "peg_insertion_hard"
WHAT = {  # a group holds, for whoever reads the picture alone
    "calibration": "hand-eye, bases, encoder zeros",
    "optics": "focal length, lens, exposure",
    "depth": "scale, offset, noise, edges",
    "timing": "latency, clocks, command delay",
    "arms": "friction, torques, payload",
    "parts": "sizes, clearance, tilt, friction",
    "grip": "how the tool sits in the hand",
    "look": "light, texture, clutter",
    "segmentation": "misses, wrong outlines",
}
LEVEL = 0.05  # of the claim that a group matters, shared among the groups that are compared (Bonferroni)
MATTERS, OTHER = "#b3261e", "#1f5fa8"  # curves of groups that matter, of the others


def run(options: Options, progress: Progress) -> dict[str, Any]:
    """All cases, the summary, and the picture."""
    names = options.conditions or tuple(POINTS)
    keep_purpose(options.out, DEVELOPMENT)
    numbers = range(options.count or COUNT)
    # Episodes in turn: what is interrupted has something of every point.
    jobs = [job_of(options, task, n, k) for k in numbers for task in options.tasks for n in names]
    found = run_episodes(CaseLog(options.out), jobs, options.spread, progress)
    summary = {task: points_of([c for c in found if c["task"] == task], names) for task in options.tasks}
    for task, points in summary.items():
        draw_sensitivity(task, points, options.out / f"{NAME}_{task}.png")
    return {"count": len(numbers), "first_cell": FIRST_CELL, "tasks": summary}


def job_of(options: Options, task: str, point: str, number: int) -> EpisodeJob:
    """The episode of a number at a point."""
    group, scale = POINTS[point]
    cell = FIRST_CELL + options.seed + number
    scales = ((group, scale),) if group else ()
    return EpisodeJob(
        key=f"{task}/{point}/{cell}",
        task=task,
        name=point,
        condition=usual_condition(task),
        seed=seed_of(cell, "episode", "sensitivity", task),
        weights=options.weights,
        cell=options.cell,
        instance=str(InstanceName("typical", cell, DEVELOPMENT, scales)),
    )


def points_of(cases: list[Case], names: tuple[str, ...]) -> dict[str, dict[str, Any]]:
    """`rates` of each point of one task and, where the typical point was run, `against_typical` in pairs."""
    at = {name: [c for c in cases if c["condition"] == name] for name in names}
    points = {name: rates(some) for name, some in at.items()}
    for name in names:
        if name != TYPICAL and TYPICAL in at:
            points[name]["against_typical"] = compared(at[name], at[TYPICAL])
    return points


def ranked(points: dict[str, dict[str, Any]]) -> list[tuple[str, float, bool]]:
    """Groups by what their largest size costs, the costliest first: group, lost share, whether it matters.

    One matters if its largest size fails more often than the typical one, in pairs, at `LEVEL` over all.
    A group that was not compared comes last, with a loss of nan.
    """
    largest: dict[str, dict[str, Any]] = {}
    for name, (group, scale) in POINTS.items():  # from the largest scale down
        if scale > 1.0 and "against_typical" in points.get(name, {}):
            largest.setdefault(group, points[name]["against_typical"])
    there = [(g, -one["gain"], one["p_less_often"] * len(largest) < LEVEL) for g, one in largest.items()]
    there.sort(key=lambda one: -one[1])
    return there + [(g, float("nan"), False) for g in GROUPS if g not in largest]


def draw_sensitivity(task: str, points: dict[str, dict[str, Any]], path: Path) -> None:
    """A panel for each group, costliest first: success over its scale, with Wilson intervals.

    `points` as from `points_of`. Groups that matter are red; a panel's title has the points of success lost.
    """
    columns = 3
    rows = -(-len(GROUPS) // columns)
    size = (3.1 * columns, 2.1 * rows + 0.8)
    figure, axes = plt.subplots(rows, columns, figsize=size, sharex=True, sharey=True, layout="constrained")
    for axis in axes.ravel()[len(GROUPS) :]:
        axis.set_axis_off()
    for axis, (group, lost, matters) in zip(axes.ravel(), ranked(points), strict=False):
        there = [(s, points[n]) for n, (g, s) in POINTS.items() if n in points and g in ("", group)]
        there.sort(key=lambda one: one[0])
        scale = np.array([s for s, _ in there])
        share = 100 * np.array([row["value"] for _, row in there])
        ends = 100 * np.array([row["ci95"] for _, row in there]).reshape(-1, 2)  # a group may have no point
        errors = np.clip(np.stack([share - ends[:, 0], ends[:, 1] - share]), 0.0, None)
        axis.errorbar(scale, share, yerr=errors, marker="o", capsize=3, color=MATTERS if matters else OTHER)
        axis.set_xscale("log", base=2)
        axis.set_xticks((0.5, 1, 2, 4), ("0.5", "1", "2", "4"))
        axis.set(ylim=(-4, 104))
        lead = group if np.isnan(lost) else f"{group} {100 * -lost:+.0f} points"
        axis.set_title(f"{lead}\n{WHAT[group]}", fontsize=9, color=MATTERS if matters else "black")
        axis.grid(alpha=0.3)
    trials = sorted({row["trials"] for row in points.values()})
    least = f"{trials[0]}" if len(trials) == 1 else f"{trials[0]} to {trials[-1]}"
    figure.suptitle(
        f"{task.replace('_', ' ')}: one group of differences at a time, {least} episodes per point\n"
        f"red: fails more often at its largest size than at typical (paired, {LEVEL:g} over all groups)",
        fontsize="medium",
    )
    figure.supxlabel("times the typical size")
    figure.supylabel("success by truth [%], 95 % intervals")
    save_figure(figure, path, dpi=110)
    plt.close(figure)


EXPERIMENT = Experiment(
    NAME,
    "success against the size of each group of a cell's differences, one group at a time",
    (DEFAULT,),
    run,
    on_request=tuple(name for name in EVERY_TASK if name != DEFAULT),
    conditions=tuple(POINTS),
)
