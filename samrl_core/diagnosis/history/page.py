"""history.html and history.png: verdicts by day, and parameters over time with their steps."""

from __future__ import annotations

from datetime import UTC, datetime
from functools import cache
from pathlib import Path

import matplotlib.dates as dates
import numpy as np
from jinja2 import Environment
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from samrl_core.common.figure_file import picture_bytes
from samrl_core.common.templates import read_templates, sources_of
from samrl_core.diagnosis.history.history import History, Series
from samrl_core.diagnosis.report import words
from samrl_core.diagnosis.report.figures import GRID, INK, NAMED, NOMINAL

TEMPLATES = Path(__file__).parent / "templates"
REPORT_TEMPLATES = Path(words.__file__).parent / "templates"
WIDTH, ROW, DPI = 9.6, 1.7, 110  # [inch], of a row, dots per inch
PICTURE_ROWS = 24  # at most, in history.png; the page has them all


def to_html(history: History) -> str:
    """One page without any outside part but links to the reports beside it."""
    return (
        _environment()
        .get_template("history.html.j2")
        .render(
            history=history,
            steps=lambda robot: [(s, c, *s.between(c)) for s in _of(history, robot) for c in s.steps],
            drawn=lambda robot: [(s, _svg(s)) for s in _of(history, robot)],
            when=_when,
        )
    )


def to_png(history: History) -> bytes:
    """The parameters with steps first, then the others."""
    chosen = sorted(history.series, key=lambda s: -len(s.steps))[:PICTURE_ROWS]
    figure = _figure(max(len(chosen), 1))
    if not chosen:
        axes = figure.add_subplot()
        axes.axis("off")
        axes.text(0.5, 0.5, "no effect was named on any day", ha="center", color=INK)
    for k, series in enumerate(chosen):
        _draw_series(figure.add_subplot(len(chosen), 1, k + 1), series, f"{series.robot}: ")
    return picture_bytes(figure, metadata={"Software": None})


@cache
def _environment() -> Environment:
    return read_templates([TEMPLATES, REPORT_TEMPLATES], words=words, source=sources_of(REPORT_TEMPLATES))


def _of(history: History, robot: str) -> list[Series]:
    return [s for s in history.series if s.robot == robot]


def _when(time_s: float | None) -> str:
    return "" if time_s is None else f"{datetime.fromtimestamp(time_s, UTC):%Y-%m-%d %H:%M} UTC"


def _figure(rows: int) -> Figure:
    # Without pyplot: no global figures, no display.
    figure = Figure(figsize=(WIDTH, ROW * rows + 0.3), dpi=DPI, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def _svg(series: Series) -> Markup:
    figure = _figure(1)
    _draw_series(figure.add_subplot(), series, "")
    text = picture_bytes(figure, "svg", metadata={"Date": None}).decode()
    return Markup(text[text.index("<svg") :])  # without XML's prologue; matplotlib escapes what it writes


def _draw_series(axes: Axes, series: Series, prefix: str) -> None:
    """Values with 95 % intervals: filled where the effect was named; means between steps as lines."""
    points = series.points
    dated = all(p.time_s is not None for p in points)
    x = np.array([dates.date2num(datetime.fromtimestamp(p.time_s or 0.0, UTC)) for p in points])
    x = x if dated else np.array([float(p.order) for p in points])
    for named, face in ((True, NAMED), (False, "white")):
        some = [k for k, p in enumerate(points) if p.named is named]
        if some:
            low = [points[k].value - points[k].ci95[0] for k in some]
            high = [points[k].ci95[1] - points[k].value for k in some]
            axes.errorbar(
                x[some],
                [points[k].value for k in some],
                yerr=np.maximum([low, high], 0.0),
                fmt="o",
                color=NAMED,
                markerfacecolor=face,
                markersize=5,
                capsize=2,
                lw=1.2,
            )
    edges = [0, *(step.index for step in series.steps), len(points)]
    for k, step in enumerate(series.steps):
        axes.axvline(0.5 * (x[step.index - 1] + x[step.index]), color=NOMINAL, lw=1.5, ls="--")
        axes.plot(x[[edges[k], edges[k + 1] - 1]], [step.before] * 2, color=INK, lw=1.2)
    if series.steps:
        axes.plot(x[[edges[-2], edges[-1] - 1]], [series.steps[-1].after] * 2, color=INK, lw=1.2)
    if dated:
        axes.xaxis.set_major_formatter(dates.ConciseDateFormatter(locator := dates.AutoDateLocator()))
        axes.xaxis.set_major_locator(locator)
    else:
        axes.set_xticks(x, [p.day.replace("$", r"\$") for p in points])
    title = f"{prefix}{words.effect(series.effect)}, {series.parameter}".replace("$", r"\$")
    axes.set_title(title, fontsize=10, loc="left")
    axes.set_ylabel(f"[{series.unit}]", fontsize=9)
    axes.grid(color=GRID, lw=0.7)
    axes.tick_params(labelsize=8.5)
    axes.spines[["top", "right"]].set_visible(False)
