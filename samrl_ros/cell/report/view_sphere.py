"""Plotly figure of the views of a run, on the sphere about the target."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go

from samrl_core.cell.tasks.task import ViewRegion
from samrl_core.diagnosis.report.figures import INK, NAMED, plot_layout
from samrl_ros.cell.report.figures import plotly_text
from samrl_ros.cell.report.run_record import ConsideredView

DOTS = 3000  # views that were scored, at most; the last ones
OVERLAP = 0.06  # of labels, in radii of the sphere


def view_figure(
    views: list[ConsideredView], region: ViewRegion, scored: Sequence[np.ndarray] = ()
) -> go.Figure:
    """Views on the sphere about the target, drawn without WebGL: a parallel projection from a raised camera.

    A marker is a view that was considered, its colour the score; a line joins those that the camera took.
    """
    axes = _screen_axes(region)
    fig = go.Figure(layout=plot_layout(430))
    radius = float(np.mean(region.distance))
    for line in _graticule():
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
    _add_scored(fig, scored, region, axes, radius)
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
            text=labels_of([views[i] for i in chosen], flat[chosen]),
            textposition="top center",
            textfont={"size": 11},
            customdata=[
                [
                    views[i].episode,
                    f"{views[i].score:.3f}",
                    f"{views[i].present_score:.3f}",
                    plotly_text(views[i].reason),
                    views[i].step,
                ]
                for i in chosen
            ],
            hovertemplate="episode %{customdata[0]}, action %{customdata[4]}<br>score %{customdata[1]},"
            " present view %{customdata[2]}<br>%{customdata[3]}<extra></extra>",
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


def _add_scored(
    fig: go.Figure, scored: Sequence[np.ndarray], region: ViewRegion, axes: np.ndarray, radius: float
) -> None:
    """Every view that was scored, as a small dot."""
    points = np.concatenate(scored)[-DOTS:] if len(scored) else np.zeros((0, 4))
    if not len(points):
        return
    flat = np.round((points[:, :3] - region.target) / radius @ axes[:2].T, 3)
    fig.add_scatter(
        x=flat[:, 0],
        y=flat[:, 1],
        mode="markers",
        name="scored",
        customdata=np.round(points[:, 3], 3),
        hovertemplate="score %{customdata}<extra></extra>",
        marker={"size": 5, "color": np.round(points[:, 3], 3), "coloraxis": "coloraxis", "opacity": 0.7},
    )


def labels_of(views: list[ConsideredView], places: np.ndarray) -> list[str]:
    """Numbers of the actions; of views that stand in one place the first says them all, shortened."""
    labels = []
    for i, place in enumerate(places):
        near = np.flatnonzero(np.linalg.norm(places - place, axis=1) < OVERLAP)
        steps = [views[k].step for k in near]
        if near[0] < i:
            labels.append("")
        elif len(steps) <= 3:
            labels.append(", ".join(map(str, steps)))
        else:
            labels.append(f"{steps[0]} ... {steps[-1]}")
    return labels


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


def _graticule() -> list[np.ndarray]:
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
