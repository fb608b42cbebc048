"""The figure of `model_updating`: per study the model before and after, the real image, and the curves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from samrl_core.common.figure_file import save_figure

_COLUMNS = ("before", "after", "real")
_TITLES = {"before": "model before", "after": "model after", "real": "real image"}


def write_picture(
    curves: dict[str, list[list[float]]], iterations: dict[str, int], pictures: Path, path: Path
) -> None:
    """Write a PNG.

    Args:
        curves: per study and case, L1 distance at the start and after each iteration [m].
        iterations: length of each study's axis.
        pictures: folder with `<study>.npz`; a study without is plotted without images.
        path: of the PNG.
    """
    rows = len(curves)
    fig = Figure(figsize=(12.0, 2.7 * rows), dpi=110, layout="constrained", facecolor="white")
    FigureCanvasAgg(fig)
    grid = fig.add_gridspec(rows, 4, width_ratios=(1, 1, 1, 1.9))
    for row, (name, some) in enumerate(curves.items()):
        file = pictures / f"{name}.npz"
        if file.is_file():
            with np.load(file) as images:
                for column, which in enumerate(_COLUMNS):
                    axes = fig.add_subplot(grid[row, column])
                    axes.imshow(images[which])
                    axes.set_xticks([])
                    axes.set_yticks([])
                    if row == 0:
                        axes.set_title(_TITLES[which], fontsize=9)
                    if column == 0:
                        axes.set_ylabel(name.replace("_", " "), fontsize=9)
        axes = fig.add_subplot(grid[row, 3])
        lines = 1e3 * padded(some, iterations[name] + 1)
        axes.plot(lines.T, color="0.75", linewidth=0.6)
        axes.plot(np.median(lines, axis=0), color="C3", linewidth=1.8, label=f"median of {len(some)}")
        axes.axhline(2.0, color="0.3", linewidth=0.7, linestyle=":")
        axes.set_xscale("symlog", linthresh=10.0)
        axes.set_yscale("log")
        axes.set_xlim(0, iterations[name])
        axes.set_ylabel("L1 distance [mm]", fontsize=8)
        axes.tick_params(labelsize=8)
        axes.legend(fontsize=8, loc="upper right")
        if row == rows - 1:
            axes.set_xlabel("iteration (a fit that stopped stays where it is)", fontsize=8)
    save_figure(fig, path)


def padded(curves: list[list[float]], length: int) -> np.ndarray:
    """Curves of any lengths as (N, length): the last value goes on, what is longer is cut off before it."""
    return np.array([[*c, *[c[-1]] * length][: length - 1] + [c[-1]] for c in curves])
