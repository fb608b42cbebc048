"""Summary and figure of `sample_efficiency`: success over real steps."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from samrl_core.common.figure_file import save_figure
from samrl_core.common.statistics import Share
from samrl_core.studies.experiment import Case


def summary_of(cases: Sequence[Case]) -> dict[str, Any]:
    """One task's curve.

    Returns:
        "curve": per point the mean real steps of its runs, each seed's success rate, and the share over all
        of their episodes with its Wilson interval; "gain": last point's share less the first one's.
    """
    curve, shares = [], []
    for point in sorted({case["point"] for case in cases}):
        here = sorted((c for c in cases if c["point"] == point), key=lambda c: c["seed"])
        hits, trials = sum(c["successes"] for c in here), sum(c["evaluated"] for c in here)
        share = Share.of([True] * hits + [False] * (trials - hits))
        shares.append(share.value)
        curve.append(
            {
                "point": point,
                "steps": sum(c["steps"] for c in here) / len(here),
                "success": share.as_dict(),
                "by_seed": {str(c["seed"]): c["successes"] / c["evaluated"] for c in here},
                "detected": sum(c["detected"] for c in here) / trials,
                "actions": sum(c["actions"] * c["evaluated"] for c in here) / trials,
            }
        )
    return {"policy": cases[0]["policy"], "curve": curve, "gain": shares[-1] - shares[0]}


def write_picture(tasks: dict[str, dict[str, Any]], path: Path) -> None:
    """A PNG with one axis per task: share with its interval, and each seed's rate."""
    fig = Figure(figsize=(4.2 * len(tasks), 3.4), dpi=110, layout="constrained", facecolor="white")
    FigureCanvasAgg(fig)
    for number, (name, task) in enumerate(tasks.items()):
        axes = fig.add_subplot(1, len(tasks), number + 1)
        curve = task["curve"]
        steps = [one["steps"] for one in curve]
        low, high = zip(*(one["success"]["ci95"] for one in curve), strict=True)
        axes.fill_between(steps, low, high, color="C0", alpha=0.2, linewidth=0.0)
        for seed in sorted({seed for one in curve for seed in one["by_seed"]}):
            own = [(one["steps"], one["by_seed"][seed]) for one in curve if seed in one["by_seed"]]
            axes.plot(*zip(*own, strict=True), color="0.6", linewidth=0.7, marker=".", markersize=3)
        shares = [one["success"]["value"] for one in curve]
        counts = [len(one["by_seed"]) for one in curve]
        fewest, most = min(counts), max(counts)
        runs = f"{most} seed{'s' * (most > 1)}" if fewest == most else f"{fewest} to {most} seeds"
        label = f"{runs}, 95 % (Wilson)"
        axes.plot(steps, shares, color="C0", linewidth=1.8, marker="o", markersize=4, label=label)
        axes.set_xscale("symlog", linthresh=250.0)
        axes.set_xlim(0, max(steps[-1], 1.0))
        axes.set_ylim(-0.02, 1.02)
        axes.set_title(f"{name.replace('_', ' ')} ({task['policy']})", fontsize=10)
        axes.set_xlabel("real steps", fontsize=9)
        axes.tick_params(labelsize=8)
        axes.grid(color="0.9", linewidth=0.5)
        if number == 0:
            axes.set_ylabel("success without exploration", fontsize=9)
        axes.legend(fontsize=8, loc="lower right")
    save_figure(fig, path)
