"""Success by condition of many episodes: rates with intervals, times, reasons of failure, and the picture."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.common.figure_file import save_figure
from samrl_core.common.statistics import Share, bootstrap_interval, mcnemar_p
from samrl_core.studies.episodes.stopwatch import GROUPS
from samrl_core.studies.experiment import Case

BAR = "#7ba7d7"


def rates(cases: Sequence[Case]) -> dict[str, Any]:
    """Figures of one condition; medians unless named otherwise.

    `detector` counts how often the model's detection, done or not, agreed with truth.
    """
    actions = max(1, sum(c["actions"] for c in cases))
    return {
        **Share.of([c["success"] for c in cases]).as_dict(),
        "detector": Share.of([c["believed"] == c["success"] for c in cases]).as_dict(),
        "failures": dict(Counter(_short(c["why"]) for c in cases if not c["success"])),
        "actions": float(np.median([c["actions"] for c in cases])),
        "camera_moves": float(np.mean([c["camera_moves"] for c in cases])),
        "simulated_s": float(np.median([c["simulated_s"] for c in cases])),
        "final_error_mm": float(1e3 * np.median([c["final_error"] for c in cases])),
        "cpu_s": float(np.mean([sum(c["cpu_s"].values()) for c in cases])),
        "cpu_s_per_action": {g: sum(c["cpu_s"][g] for c in cases) / actions for g in GROUPS},
        "wall_s_per_action": {g: sum(c["wall_s"][g] for c in cases) / actions for g in GROUPS},
    }


def compared(cases: Sequence[Case], others: Sequence[Case]) -> dict[str, Any]:
    """Whether the first condition succeeds more often than the second, on the seeds that both have.

    Raises:
        InputError: they have none in common.
    """
    mine, theirs = ({c["seed"]: bool(c["success"]) for c in some} for some in (cases, others))
    seeds = [s for s in mine if s in theirs]
    if not seeds:
        raise InputError("two conditions have no seed in common; run both from the same --seed")
    first, second = [mine[s] for s in seeds], [theirs[s] for s in seeds]
    differences = [int(a) - int(b) for a, b in zip(first, second, strict=True)]

    def mean(some: Sequence[int]) -> float:
        return float(np.mean(some))

    return {
        "pairs": len(seeds),
        "gain": mean(differences),
        "gain_ci95": bootstrap_interval(differences, mean, np.random.default_rng(0)),
        "p_more_often": mcnemar_p(first, second),
        "p_less_often": mcnemar_p(second, first),
    }


def write_bars(summary: dict[str, dict[str, dict[str, Any]]], title: str, path: Path) -> None:
    """A picture of `rates` by task and condition: a panel for each task, bars with Wilson intervals.

    Every bar has its name and its count beside it, as one of no length shows no colour.
    """
    heights = [len(of_task) + 1.2 for of_task in summary.values()]
    figure, panels = plt.subplots(
        len(summary),
        squeeze=False,
        sharex=True,
        figsize=(7.2, 0.9 + 0.27 * sum(heights)),
        height_ratios=heights,
        layout="constrained",
    )
    for axis, (task, of_task) in zip(panels[:, 0], summary.items(), strict=True):
        rows = list(of_task.values())
        places = np.arange(len(rows))
        share = 100 * np.array([row["value"] for row in rows])
        ends = 100 * np.array([row["ci95"] for row in rows])
        errors = np.clip(np.stack([share - ends[:, 0], ends[:, 1] - share]), 0.0, None)
        axis.barh(places, share, 0.75, xerr=errors, capsize=2, color=BAR, ecolor="0.25")
        axis.set_yticks(places, [name.replace("_", " ") for name in of_task], fontsize=8)
        for place, row in zip(places, rows, strict=True):
            counted = f"{row['successes']} of {row['trials']}"
            axis.annotate(counted, (103, place), va="center", fontsize=8, annotation_clip=False)
        axis.invert_yaxis()
        axis.set_title(task.replace("_", " "), fontsize=9, loc="left")
        axis.spines[["top", "right"]].set_visible(False)
    panels[-1, 0].set(xlim=(0, 102), xlabel="success by truth [%], 95 % intervals")
    figure.suptitle(title, fontsize="medium")
    save_figure(figure, path, dpi=110)
    plt.close(figure)


def _short(why: str) -> str:
    """A reason without its numbers, so that equal ones are counted together."""
    return why if len(why) < 30 else " ".join(why.split()[:6])
