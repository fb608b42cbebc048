"""The picture of a training: errors of actor and Q over the epochs, and success in the model."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt

from samrl_core.common.figure_file import save_figure
from samrl_core.learning.data.fit import LOG

COLUMNS = {
    "error_mm": "all actions",
    "near_error_mm": "short actions",
    "error": "all",
    "error_where_high": "where it is above one half",
}


def write_picture(folder: Path, summary: dict[str, Any], path: Path) -> None:
    """Left and middle: validation errors by epoch, of each round's actor and of Q. Right: success rates."""
    figure, axes = plt.subplots(1, 3, figsize=(13, 4), layout="constrained")
    for log in sorted(folder.glob(f"actor-*/{LOG}")):
        _curves(axes[0], log, ("error_mm", "near_error_mm"), f"{log.parent.name}, ")
    has_curves = bool(axes[0].lines)  # an actor that was given has no curves
    axes[0].set(xlabel="epoch", ylabel="error of the action [mm]", title=summary["task"])
    axes[0].set_ylim(bottom=0.0)
    _curves(axes[1], folder / "q" / LOG, ("error", "error_where_high"), "")
    axes[1].set(xlabel="epoch", ylabel="error of Q's target [-]", title="sensing-aware Q")
    for axis in axes[0 if has_curves else 1 : 2]:
        axis.legend(fontsize=8)
    names = list(summary["success"])
    bars = axes[2].bar(range(len(names)), [100 * summary["success"][n]["success"] for n in names])
    axes[2].bar_label(bars, fmt="%.0f %%")
    axes[2].set_xticks(range(len(names)), [n.replace("_", " ") for n in names])
    axes[2].set(ylim=(0, 110), ylabel="success in the model [%]", title="views")
    save_figure(figure, path, dpi=110)
    plt.close(figure)


def _curves(axis: Any, log: Path, names: tuple[str, ...], prefix: str) -> None:
    with log.open(newline="") as file:
        rows = list(csv.DictReader(file))
    for name in names:
        points = [(float(row["epoch"]), float(row[name])) for row in rows if row.get(name)]
        if points:
            axis.plot(*zip(*points, strict=True), ".-", label=prefix + COLUMNS[name])
