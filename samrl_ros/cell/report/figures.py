"""Plotly figures of a run. Times count from the bag's start; long signals keep their extremes."""

from __future__ import annotations

import html

import numpy as np
import plotly.graph_objects as go

from samrl_core.diagnosis.report.figures import AXIS, INK, NAMED, NOMINAL, plot_layout
from samrl_ros.cell.report.run_record import RunRecord
from samrl_ros.cell.report.tracking import Tracking

STAGES = ("update", "view", "look", "act", "move")  # of Algorithm 1, in their order; others follow
POINTS = 1500  # of a joint's curve: twice the pixels of a phone, about those of a wide screen
# Okabe and Ito (2008), told apart with every kind of colour blindness.
ROW_COLORS = ("#0072b2", "#d55e00", "#009e73", "#aa4499", "#8a6d00", "#56b4e9", "#555555")
EVENT_COLORS = {"ok": "#009e73", "warning": "#c77700", "stale": "#c77700"}
EVENT_COLOR = "#b3261e"


def timeline_figure(run: RunRecord) -> go.Figure:
    """Phases as bars, one row each, and events as lines."""
    stages = [p for p in run.phases if not p.name.startswith("episode ")]
    names = list(dict.fromkeys([*(s for s in STAGES if any(p.name == s for p in stages)), *_others(stages)]))
    fig = go.Figure(layout=plot_layout(150 + 26 * max(len(names), 1)))
    for row, name in enumerate(names):
        chosen = [p for p in stages if p.name == name]
        fig.add_bar(
            orientation="h",
            base=[round(p.start - run.start, 3) for p in chosen],
            x=[round(p.end - p.start, 3) for p in chosen],
            y=[plotly_text(name)] * len(chosen),
            marker={"color": ROW_COLORS[row % len(ROW_COLORS)], "line": {"width": 0}},
            hovertemplate="%{y}: %{x:.2f} s from %{base:.2f} s<extra></extra>",
            showlegend=False,
        )
    for phase in run.phases:
        if phase.name.startswith("episode "):
            note = {"text": plotly_text(phase.name), "font": {"size": 11}, "yanchor": "bottom", "y": 1.0}
            fig.add_vline(
                x=phase.start - run.start, line={"color": INK, "width": 1, "dash": "dash"}, annotation=note
            )
    for event in [e for e in run.events if e.safety][:60]:
        color = EVENT_COLORS.get(event.level, EVENT_COLOR)
        fig.add_vline(x=event.time - run.start, line={"color": color, "width": 1.5})
    fig.update_xaxes(title="robot time [s]", range=[0, max(run.duration, 1e-3)], zeroline=False, **AXIS)
    fig.update_yaxes(categoryorder="array", categoryarray=[plotly_text(n) for n in reversed(names)], **AXIS)
    return fig.update_layout(bargap=0.25, barmode="overlay", margin={"t": 30})


def _others(stages: list) -> list[str]:
    return sorted({p.name for p in stages} - set(STAGES))


def loss_figure(run: RunRecord) -> go.Figure:
    """Loss of each model update, before and after."""
    fig = go.Figure(layout=plot_layout(270))
    time = [f.time - run.start for f in run.fits]
    for name, values, color, dash in (
        ("before the update", [f.before for f in run.fits], NOMINAL, "dot"),
        ("after", [f.after for f in run.fits], NAMED, "solid"),
    ):
        fig.add_scatter(
            x=np.round(time, 3),
            y=np.asarray(values, dtype=np.float32),
            name=name,
            mode="lines+markers",
            line={"color": color, "dash": dash, "width": 1.8},
            marker={"size": 5},
            hovertemplate="%{y:.4g} at %{x:.2f} s<extra></extra>",
        )
    fig.update_xaxes(title="robot time [s]", range=[0, max(run.duration, 1e-3)], zeroline=False, **AXIS)
    return fig.update_yaxes(title="loss [-]", rangemode="tozero", **AXIS)


def action_figure(run: RunRecord) -> go.Figure:
    """Length of each action's nominal part and of its residual."""
    fig = go.Figure(layout=plot_layout(270))
    time = np.round([a.time - run.start for a in run.actions], 3)
    for name, lengths, color, symbol in (
        ("nominal", [a.nominal for a in run.actions], NAMED, "circle"),
        ("residual", [a.residual for a in run.actions], NOMINAL, "diamond"),
    ):
        fig.add_scatter(
            x=time,
            y=1e3 * np.asarray(lengths),
            name=name,
            mode="lines+markers",
            line={"color": color, "width": 1.5},
            marker={"size": 6, "symbol": symbol},
            hovertemplate="%{y:.2f} mm at %{x:.2f} s<extra></extra>",
        )
    fig.update_xaxes(title="robot time [s]", range=[0, max(run.duration, 1e-3)], zeroline=False, **AXIS)
    return fig.update_yaxes(title="length [mm]", rangemode="tozero", **AXIS)


def tracking_figure(tracking: Tracking, start: float) -> go.Figure:
    """Commanded minus measured position of an arm's joints [mrad]."""
    fig = go.Figure(layout=plot_layout(320))
    for j, joint in enumerate(tracking.joints):
        keep = extremes(tracking.error[:, j], POINTS)
        fig.add_scatter(
            x=np.round(tracking.time[keep] - start, 3),
            y=np.round(1e3 * tracking.error[keep, j], 4),
            name=plotly_text(joint),
            mode="lines",
            line={"color": ROW_COLORS[j % len(ROW_COLORS)], "width": 1.2},
            hovertemplate="%{y:.3f} mrad at %{x:.3f} s",
        )
    fig.update_xaxes(title="robot time [s]", zeroline=False, **AXIS)
    return fig.update_yaxes(title="error [mrad]", zerolinecolor="#9aa5b1", **AXIS)


def extremes(signal: np.ndarray, points: int) -> np.ndarray:
    """Indices that keep lowest and highest sample of each of `points` / 2 buckets, and both ends."""
    n = len(signal)
    if n <= points:
        return np.arange(n)
    edges = np.linspace(0, n, points // 2 + 1).astype(int)
    keep = [0, n - 1]
    for low, high in zip(edges[:-1], edges[1:], strict=True):
        part = signal[low:high]
        keep += [low + int(np.argmin(part)), low + int(np.argmax(part))]
    return np.unique(keep)


def plotly_text(text: str) -> str:
    """Plotly reads a few tags in its texts, so names are escaped there as well."""
    return html.escape(text, quote=False)
