"""The picture of `fig6`: per task one row, per phase the map of Q beside that of the action error."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from samrl_core.cell.tasks import task_named
from samrl_core.common.figure_file import save_figure
from samrl_core.studies.paper.expert_states import PHASES
from samrl_core.studies.paper.view_maps import view_grid


def write_picture(
    path: Path,
    cases: list[dict[str, Any]],
    reached: dict[str, np.ndarray],
    size: tuple[int, int],
    summary: dict[str, Any],
) -> None:
    """Write a PNG: the first episode's maps, and the correlations of all states.

    Args:
        path: of the PNG.
        cases: of all tasks and episodes, with their maps.
        reached: per task, which views (V,) the camera arm takes; the others are hatched.
        size: azimuths and elevations of the maps.
        summary: per task, by phase.
    """
    tasks = list(reached)
    fig = Figure(figsize=(18.0, 3.3 * len(tasks) + 0.6), dpi=100, layout="constrained", facecolor="white")
    FigureCanvasAgg(fig)
    whole = fig.add_gridspec(len(tasks), 2, width_ratios=(6.2, 1))
    for row, task in enumerate(tasks):
        of_task = [case for case in cases if case["task"] == task]
        grid = whole[row, 0].subgridspec(2, len(PHASES))
        for column, phase in enumerate(PHASES):
            case = next(c for c in of_task if c["phase"] == phase)
            for line, (name, factor, label) in enumerate((("q", 1.0, "Q [-]"), ("error", 1e3, "error [mm]"))):
                axes = fig.add_subplot(grid[line, column])
                values = factor * np.array(case[name])
                image = _map(axes, task, values, reached[task], size, "viridis" if line == 0 else "magma_r")
                bar = fig.colorbar(image, ax=axes, pad=0.01, aspect=9)
                bar.set_label(label, fontsize=8)
                bar.ax.tick_params(labelsize=7)
                if line == 0:
                    axes.set_title(
                        f"{100 * phase:.0f} % of the way, to '{case['sub_goal']}'; here Spearman "
                        f"{case['spearman']['clean']:+.2f}",
                        fontsize=9,
                    )
                    axes.set_xticklabels([])
                else:
                    axes.set_xlabel("azimuth [deg]", fontsize=8)
                if column == 0:
                    axes.set_ylabel(f"{task.replace('_', ' ')}\nelevation [deg]", fontsize=8)
        _correlations(fig.add_subplot(whole[row, 1]), task, of_task, summary[task])
    fig.suptitle(
        "Q (green to yellow: high) and the actor's action error (light: low) of one state per phase over the "
        "view; hatched: out of the camera arm's reach; star: best view of the map",
        fontsize=10,
    )
    save_figure(fig, path)


def _map(
    axes: Axes, task: str, values: np.ndarray, reached: np.ndarray, size: tuple[int, int], colors: str
) -> Any:
    grid = view_grid(task_named(task).view_region(), *size)
    azimuth, elevation = np.rad2deg(grid.azimuth), np.rad2deg(grid.elevation)
    shaped = values.reshape(grid.shape)
    image = axes.pcolormesh(azimuth, elevation, shaped, cmap=colors, shading="nearest")
    if not reached.all():
        out = np.ma.masked_where(reached.reshape(grid.shape), np.ones(grid.shape))
        clear = ListedColormap([(0.0, 0.0, 0.0, 0.0)])
        axes.pcolor(
            *(azimuth, elevation, out),
            cmap=clear,
            hatch="////",
            edgecolor="0.85",
            linewidth=0.0,
            shading="nearest",
        )
    best = np.unravel_index(int(shaped.argmax() if colors == "viridis" else shaped.argmin()), grid.shape)
    axes.plot(azimuth[best[1]], elevation[best[0]], "*", color="red", markersize=9, markeredgecolor="white")
    axes.tick_params(labelsize=7)
    axes.set_xticks(np.linspace(-150, 150, 6) if azimuth[-1] < 170 else np.linspace(-180, 120, 6))
    return image


def _correlations(axes: Axes, task: str, cases: list[dict[str, Any]], summary: dict[str, Any]) -> None:
    """Each state's rank correlation, and the median with its interval."""
    rng = np.random.default_rng(0)
    for column, phase in enumerate(PHASES):
        values = [case["spearman"]["clean"] for case in cases if case["phase"] == phase]
        axes.plot(column + rng.uniform(-0.15, 0.15, len(values)), values, ".", color="0.6", markersize=4)
        found = summary[str(phase)]["spearman"]["clean"]
        low, high = found["interval95"]
        axes.errorbar(
            column + 0.28,
            found["median"],
            [[found["median"] - low], [high - found["median"]]],
            fmt="o",
            color="C0",
            capsize=3,
            markersize=4,
        )
    axes.axhline(0.0, color="0.7", linewidth=0.6)
    axes.axhline(0.7, color="0.3", linewidth=0.7, linestyle=":")
    axes.set_ylim(-1, 1)
    axes.set_xlim(-0.5, len(PHASES) - 0.4)
    axes.set_xticks(range(len(PHASES)), [f"{100 * p:.0f} %" for p in PHASES], fontsize=8)
    axes.tick_params(labelsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    count = len({case["seed"] for case in cases})
    axes.set_title(f"{task.replace('_', ' ')}\n{count} episodes: median, 95 %", fontsize=9)
    axes.set_ylabel("Spearman(Q, -error), clean", fontsize=8)
