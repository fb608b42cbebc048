"""The picture of `fig7`: per task the image, what actor and Q go by, and energy over area."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from samrl_core.common.figure_file import save_figure
from samrl_core.policy.networks.network_image import COLOR_CENTER, COLOR_UNIT
from samrl_core.studies.paper.saliency import NETWORKS, Examined, SaliencySettings

_NAMES = {"actor": "actor's error", "q": "Q"}


def write_picture(
    path: Path, shown: dict[str, Examined], summary: dict[str, Any], settings: SaliencySettings
) -> None:
    """Write a PNG.

    Args:
        path: of the PNG.
        shown: per task one state; its first view is shown.
        summary: per task and network.
        settings: of the patches.
    """
    rows = len(shown)
    fig = Figure(figsize=(17.0, 2.9 * rows + 0.5), dpi=100, layout="constrained", facecolor="white")
    FigureCanvasAgg(fig)
    grid = fig.add_gridspec(rows, 6, width_ratios=(1, 1.15, 1.2, 1.15, 1.2, 1.0))
    for row, (task, one) in enumerate(shown.items()):
        image = np.clip(one.images[0, :3].transpose(1, 2, 0) * COLOR_UNIT + COLOR_CENTER, 0.0, 1.0)
        axes = _blank(fig.add_subplot(grid[row, 0]), image)
        _outline(axes, one.target[0], "red")
        _outline(axes, one.objects[0], "white")
        axes.set_ylabel(task.replace("_", " "), fontsize=9)
        if row == 0:
            axes.set_title("image; outlined: target (red),\nall objects of the task (white)", fontsize=8)
        for k, network in enumerate(NETWORKS):
            gradient, covered = one.gradients[network][0], one.covered[network][0]
            axes = _blank(fig.add_subplot(grid[row, 1 + 2 * k]), image.mean(axis=2), "gray")
            axes.imshow(gradient / gradient.max(), cmap="inferno", alpha=0.75, vmin=0.0, vmax=1.0)
            _outline(axes, one.target[0], "cyan")
            if row == 0:
                axes.set_title(f"gradient of {_NAMES[network]}\n(dark: 0, bright: the most)", fontsize=8)
            axes = _blank(fig.add_subplot(grid[row, 2 + 2 * k]), image.mean(axis=2), "gray")
            half, size = settings.patch / 2.0, settings.stride
            high, wide = covered.shape
            first, last = half - size / 2.0 - 0.5, half + size / 2.0 - 0.5
            extent = (first, last + (wide - 1) * size, last + (high - 1) * size, first)
            unit = 1e3 if network == "actor" else 1.0
            overlay = axes.imshow(unit * covered, cmap="inferno", alpha=0.75, extent=extent, vmin=0.0)
            axes.set(xlim=(-0.5, image.shape[1] - 0.5), ylim=(image.shape[0] - 0.5, -0.5))
            _outline(axes, one.target[0], "cyan")
            bar = fig.colorbar(overlay, ax=axes, pad=0.02, aspect=14)
            bar.set_label("way of the action [mm]" if network == "actor" else "change of Q [-]", fontsize=7)
            bar.ax.tick_params(labelsize=7)
            if row == 0:
                what = "action" if network == "actor" else "Q"
                axes.set_title(f"{what} with a patch of {settings.patch} px\ncovered there", fontsize=8)
        _ratios(fig.add_subplot(grid[row, 5]), summary[task], row == 0)
    fig.suptitle(
        "Which pixels actor and Q go by: one state per task, half way of an expert's episode", fontsize=10
    )
    save_figure(fig, path)


def _blank(axes: Axes, image: np.ndarray, colors: str | None = None) -> Axes:
    axes.imshow(image, cmap=colors, vmin=0.0, vmax=1.0)
    axes.set_xticks([])
    axes.set_yticks([])
    return axes


def _outline(axes: Axes, mask: np.ndarray, color: str) -> None:
    if 0 < mask.sum() < mask.size:
        axes.contour(mask.astype(float), [0.5], colors=[color], linewidths=0.8)


def _ratios(axes: Axes, found: dict[str, Any], first: bool) -> None:
    """Medians with intervals of energy's share over area's."""
    for k, network in enumerate(NETWORKS):
        for i, (mask, color) in enumerate((("target", "C3"), ("objects", "0.5"))):
            one = found[network][f"{mask}_energy_over_area"]
            low, high = one["interval95"]
            position, value = k + 0.36 * i - 0.18, one["median"]
            axes.bar(position, value, 0.34, color=color, label=mask if k == 0 else None)
            axes.errorbar(
                position, value, [[value - low], [high - value]], color="black", capsize=3, linewidth=1
            )
    axes.axhline(1.0, color="0.3", linewidth=0.7, linestyle=":")
    axes.set_xticks(range(len(NETWORKS)), ["actor", "Q"], fontsize=8)
    axes.tick_params(labelsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_ylabel("share of energy / of area [-]", fontsize=8)
    if first:
        axes.set_title("median of all states and views,\n95 % over episodes", fontsize=8)
        axes.legend(fontsize=7)
