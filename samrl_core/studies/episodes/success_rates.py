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
    """A picture of `rates` by task and condition: bars of success with Wilson intervals.

    Bars of one task have their names below, as a bar of no height shows no colour.
    """
    names = list(dict.fromkeys(name for of_task in summary.values() for name in of_task))
    figure, axis = plt.subplots(figsize=(2.5 + 3.2 * len(summary), 4.2), layout="constrained")
    width = 0.85 / len(names)
    for k, name in enumerate(names):
        found = [(x, of_task[name]) for x, of_task in enumerate(summary.values()) if name in of_task]
        positions = [x + (k - (len(names) - 1) / 2) * width for x, _ in found]
        share = 100 * np.array([row["value"] for _, row in found])
        ends = 100 * np.array([row["ci95"] for _, row in found])
        errors = np.clip(np.stack([share - ends[:, 0], ends[:, 1] - share]), 0.0, None)
        axis.bar(positions, share, 0.92 * width, yerr=errors, capsize=2, label=name.replace("_", " "))
        for position, row in zip(positions, (row for _, row in found), strict=True):
            axis.annotate(
                f"n={row['trials']}", (position, 1), rotation=90, ha="center", va="bottom", fontsize=6
            )
    axis.set(ylim=(0, 105), ylabel="success by truth [%], 95 % intervals", title=title)
    if len(summary) == 1:
        below = (np.arange(len(names)) - (len(names) - 1) / 2) * width
        labels = [name.replace("_", " ") for name in names]
        axis.set_xticks(below, labels, rotation=30, ha="right", fontsize=8)
        axis.set_xlabel(next(iter(summary)).replace("_", " "))
    else:
        axis.set_xticks(range(len(summary)), [task.replace("_", " ") for task in summary])
        axis.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    save_figure(figure, path, dpi=110)
    plt.close(figure)


def _short(why: str) -> str:
    """A reason without its numbers, so that equal ones are counted together."""
    return why if len(why) < 30 else " ".join(why.split()[:6])
