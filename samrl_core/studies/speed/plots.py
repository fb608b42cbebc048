"""Pictures of benchmark results."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from samrl_core.common.figure_file import save_figure

_NAMES = ("triangles", "lit", "environments", "points", "batch")  # what distinguishes the rows of one part


def ratios(report: Mapping[str, Any]) -> dict[str, float]:
    """Every ratio of a report, labelled by its part and row; above 1 the model is the faster."""
    found = {}
    for part, content in report.items():
        for row in content if isinstance(content, list) else [content]:
            if not isinstance(row, Mapping):
                continue
            case = ", ".join(
                f"{row[k]} {k}" if k != "lit" else ("lit" if row[k] else "unlit") for k in _NAMES if k in row
            )
            for key, value in row.items():
                if "ratio" in key:
                    found[
                        " ".join(x for x in (part, f"({case})" if case else "", key.replace("_", " ")) if x)
                    ] = value
    return found


def ratio_picture(report: Mapping[str, Any], path: Path) -> None:
    """Bars of all ratios, with a line where both are equally fast."""
    found = ratios(report)
    figure = Figure(figsize=(9.0, 1.2 + 0.4 * max(1, len(found))), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    names = list(found)[::-1]
    bars = axes.barh(
        names, [found[n] for n in names], color=["#2f7fb8" if found[n] >= 1 else "#c2552d" for n in names]
    )
    axes.bar_label(bars, [f" {found[n]:.3g}x" for n in names])
    axes.axvline(1.0, color="black", linewidth=1)
    axes.set_xscale("log")
    axes.margins(x=0.15)
    axes.set_xlabel("times faster than the peer, same run")
    save_figure(figure, path, dpi=110)


def rate_picture(result: Mapping[str, Any], path: Path) -> None:
    """Images and steps per second over the size of the batch."""
    figure = Figure(figsize=(10.0, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    groups = [(left, "images", result["images"])]
    groups += [(right, name, rows) for name, rows in result["steps"].items()]
    for axes, name, rows in groups:
        for kind, style in (("forward", "o-"), ("both", "s--")):
            label = f"{name}, {'forward' if kind == 'forward' else 'forward and backward'}"
            axes.plot([r["batch"] for r in rows], [r[f"{kind}_per_second"] for r in rows], style, label=label)
    for axes, what in ((left, "images of 128 x 128 per second"), (right, "steps of 1/240 s per second")):
        axes.set(xscale="log", yscale="log", xlabel="batch", ylabel=what)
        axes.grid(True, alpha=0.3)
        axes.legend(fontsize=8)
    figure.suptitle(str(result["device"]))
    save_figure(figure, path, dpi=110)
