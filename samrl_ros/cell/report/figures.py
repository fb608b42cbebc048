"""Plotly figures of a run. Times count from the bag's start; long signals keep their extremes."""

from __future__ import annotations

import html
import math

import numpy as np
import plotly.graph_objects as go

from samrl_core.cell.tasks.task import ViewRegion
from samrl_core.diagnosis.report.figures import AXIS, INK, NAMED, NOMINAL, ROW_COLORS, plot_layout
from samrl_ros.cell.report.run_record import ConsideredView, RunRecord
from samrl_ros.cell.report.tracking import Tracking

STAGES = ("update", "view", "look", "act", "move")  # of Algorithm 1, in their order; others follow
POINTS = 1500  # of a joint's curve: twice the pixels of a phone, about those of a wide screen
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
            y=[_text(name)] * len(chosen),
            marker={"color": ROW_COLORS[row % len(ROW_COLORS)], "line": {"width": 0}},
            hovertemplate="%{y}: %{x:.2f} s from %{base:.2f} s<extra></extra>",
            showlegend=False,
        )
    for phase in run.phases:
        if phase.name.startswith("episode "):
            note = {"text": _text(phase.name), "font": {"size": 11}, "yanchor": "bottom", "y": 1.0}
            fig.add_vline(
                x=phase.start - run.start, line={"color": INK, "width": 1, "dash": "dash"}, annotation=note
            )
    for event in [e for e in run.events if e.safety][:60]:
        color = EVENT_COLORS.get(event.level, EVENT_COLOR)
        fig.add_vline(x=event.time - run.start, line={"color": color, "width": 1.5})
    fig.update_xaxes(title="robot time [s]", range=[0, max(run.duration, 1e-3)], zeroline=False, **AXIS)
    fig.update_yaxes(categoryorder="array", categoryarray=[_text(n) for n in reversed(names)], **AXIS)
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
    return fig.update_yaxes(title="loss (eq. 6)", rangemode="tozero", **AXIS)


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
            name=_text(joint),
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


def view_figure(views: list[ConsideredView], region: ViewRegion) -> go.Figure:
    """Views on the sphere about the target, drawn without WebGL: a parallel projection from a raised camera.

    A marker is a view that was considered, its colour the score; a line joins those that the camera took.
    """
    axes = _screen_axes(region)
    fig = go.Figure(layout=plot_layout(430))
    radius = float(np.mean(region.distance))
    for line in _graticule(region):
        hidden = line @ axes[2] < -1e-9
        for part, width, dash in ((hidden, 0.6, "dot"), (~hidden, 1.0, "solid")):
            shown = np.where(part[:, None], line @ axes[:2].T, np.nan)
            fig.add_scatter(
                x=np.round(shown[:, 0], 4),
                y=np.round(shown[:, 1], 4),
                mode="lines",
                line={"color": "#b8c2cc", "width": width, "dash": dash},
                hoverinfo="skip",
                showlegend=False,
            )
    outline = _region_outline(region) @ axes[:2].T
    fig.add_scatter(
        x=np.round(outline[:, 0], 4),
        y=np.round(outline[:, 1], 4),
        mode="lines",
        fill="toself",
        fillcolor="rgba(0,114,178,.10)",
        line={"color": NAMED, "width": 1},
        name="where the camera may look from",
        hoverinfo="skip",
    )
    _add_views(fig, views, region, axes, radius)
    bound = {"visible": False, "range": [-1.25, 1.25]}
    fig.update_xaxes(scaleanchor="y", **bound)
    fig.update_yaxes(visible=False, range=[-0.5, 1.25])
    return fig.update_layout(margin={"l": 8, "r": 8, "t": 40, "b": 8})


def _add_views(
    fig: go.Figure, views: list[ConsideredView], region: ViewRegion, axes: np.ndarray, radius: float
) -> None:
    on_sphere = np.array([v.position - region.target for v in views]).reshape(-1, 3) / radius
    flat = np.round(on_sphere @ axes[:2].T, 4)
    taken = [i for i, v in enumerate(views) if v.moved]
    if len(taken) > 1:
        fig.add_scatter(
            x=flat[taken, 0],
            y=flat[taken, 1],
            mode="lines",
            line={"color": INK, "width": 1.2},
            name="way of the camera",
            hoverinfo="skip",
        )
    scores = [v.score if math.isfinite(v.score) else math.nan for v in views]
    for moved, name, symbol in ((True, "taken", "circle"), (False, "not worth its time", "circle-open")):
        chosen = [i for i, v in enumerate(views) if v.moved == moved]
        if not chosen:
            continue
        fig.add_scatter(
            x=flat[chosen, 0],
            y=flat[chosen, 1],
            mode="markers+text",
            name=name,
            text=[str(views[i].step) for i in chosen],
            textposition="top center",
            textfont={"size": 11},
            customdata=[
                [
                    views[i].episode,
                    f"{views[i].score:.3f}",
                    f"{views[i].present_score:.3f}",
                    _text(views[i].reason),
                ]
                for i in chosen
            ],
            hovertemplate="episode %{customdata[0]}, action %{text}<br>score %{customdata[1]}, present view"
            " %{customdata[2]}<br>%{customdata[3]}<extra></extra>",
            marker={
                "symbol": symbol,
                "size": 13,
                "color": [scores[i] for i in chosen],
                "coloraxis": "coloraxis",
                "line": {"width": 1.5, "color": INK} if moved else {"width": 2.5},
            },
        )
    bar = {"title": {"text": "score", "side": "right"}, "thickness": 10, "len": 0.7, "x": 1.0}
    fig.update_layout(coloraxis={"colorscale": "Viridis", "colorbar": bar})


def _screen_axes(region: ViewRegion) -> np.ndarray:
    """(3, 3): screen's right, up, and towards the reader, in world; the region's middle faces the reader."""
    azimuth, elevation = float(np.mean(region.azimuth)), math.radians(28.0)
    toward = _direction(azimuth, elevation)
    right = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
    return np.array([right, np.cross(toward, right), toward])


def _direction(azimuth: float | np.ndarray, elevation: float | np.ndarray) -> np.ndarray:
    return np.stack(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation) + 0.0 * np.asarray(azimuth),
        ],
        axis=-1,
    )


def _graticule(region: ViewRegion) -> list[np.ndarray]:
    """Circles of the upper half of a unit sphere: elevations 0, 30, 60 and eight meridians."""
    around, up = np.linspace(0, 2 * math.pi, 73), np.linspace(0, math.pi / 2, 19)
    rings = [_direction(around, np.full_like(around, math.radians(e))) for e in (0, 30, 60)]
    return rings + [_direction(np.full_like(up, a), up) for a in np.arange(8) * math.pi / 4]


def _region_outline(region: ViewRegion) -> np.ndarray:
    (a0, a1), (e0, e1) = region.azimuth, region.elevation
    a, e = np.linspace(a0, a1, 40), np.linspace(e0, e1, 20)
    sides = (
        _direction(a, np.full_like(a, e0)),
        _direction(np.full_like(e, a1), e),
        _direction(a[::-1], np.full_like(a, e1)),
        _direction(np.full_like(e, a0), e[::-1]),
    )
    return np.concatenate(sides)


def _text(text: str) -> str:
    """Plotly reads a few tags in its texts, so names are escaped there as well."""
    return html.escape(text, quote=False)
