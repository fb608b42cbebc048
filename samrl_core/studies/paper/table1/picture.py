"""The picture of Table I: success by task and condition, with its interval."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from samrl_core.common.figure_file import save_figure

_NAMES = {
    "active": "active (ours)",
    "best_fixed": "best fixed view",
    "held_random": "random view, held",
    "fixed": "start view",
    "random_each_step": "random view each step",
    "oracle": "oracle view",
}


def write_picture(tasks: dict[str, Any], path: Path) -> None:
    """Write a PNG: a row of bars per kind of image, a group per task, Wilson intervals.

    Args:
        tasks: of the summary.
        path: of the picture.
    """
    noises = list(next(iter(tasks.values())))
    figure = Figure(
        figsize=(max(8.0, 2.0 + 2.2 * len(tasks)), 3.2 * len(noises)), dpi=110, layout="constrained"
    )
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(noises), 1, sharex=True, squeeze=False)[:, 0]
    width = 0.8 / len(_NAMES)
    for axis, noise in zip(axes, noises, strict=True):
        for k, (condition, label) in enumerate(_NAMES.items()):
            shares = [of[noise]["conditions"][condition]["success"] for of in tasks.values()]
            value = np.array([share["value"] for share in shares])
            low, high = np.array([share["ci95"] for share in shares]).T
            bar = np.arange(len(tasks)) + (k - 0.5 * (len(_NAMES) - 1)) * width
            spread = np.maximum([value - low, high - value], 0.0)
            axis.bar(bar, value, 0.92 * width, yerr=spread, label=label, color=f"C{k}", capsize=2)
        axis.set_ylim(0.0, 1.05)
        axis.set_ylabel(f"success, {noise} images", fontsize=9)
        axis.grid(axis="y", color="0.9")
        axis.set_axisbelow(True)
        axis.set_xticks(range(len(tasks)), [name.replace("_", " ") for name in tasks], fontsize=9)
    figure.legend(*axes[0].get_legend_handles_labels(), fontsize=8, ncols=3, loc="outside upper center")
    save_figure(figure, path)
