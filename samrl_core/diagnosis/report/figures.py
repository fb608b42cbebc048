"""Plotly figures of a diagnosis, thinned so that the page stays small, with every name escaped."""

from __future__ import annotations

import html
import json
import math
from collections.abc import Callable
from functools import partial

import numpy as np
import plotly.graph_objects as go

from samrl_core.diagnosis.report import words
from samrl_core.diagnosis.report.tile_map import tile_figure
from samrl_core.diagnosis.result import Curve, Heatmap, Overlay, Timeline

# Colours of Okabe and Ito (2008), told apart with every kind of colour blindness; lines differ in dash too.
INK, GRID = "#1f2933", "#d9dee3"
MEASURED, NOMINAL, NAMED, RUNNER_UP = "#1f2933", "#d55e00", "#0072b2", "#aa4499"
FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Liberation Sans', sans-serif"

# ColorBrewer's YlOrRd without its darkest tones, so that dark figures stay readable on the first four.
SCALE = ("#ffffff", "#fff3c4", "#fed976", "#feb24c", "#fd8d3c", "#c8301b", "#8f0d24")
TEXT_LIGHT_FROM = 5
LEAST_THRESHOLD = 1e-3  # standard deviations; where all quiet cells are exactly zero

CURVE_POINTS = 3000
STRIP_WINDOWS = 600  # of a timeline, at most: half the pixels of a wide screen
OVERLAY_BYTES = 2_000_000  # for all overlays together, before base64 adds a third
OVERLAY_POINTS = 2400  # at most, for one signal: twice the pixels of a wide screen
BETWEEN_WINDOWS = 3.0  # steps of time from which on samples belong to two windows
OVERLAY_COUNT = 120  # at most; those with the largest error are kept


def cell_tone(value: float, threshold: float, largest: float = 0.0) -> int:
    """Which colour a value gets: below the threshold pale, then one step for every factor.

    The factor is 1.6, or so much more that the `largest` value of the picture just gets the last colour.
    """
    threshold = max(threshold, LEAST_THRESHOLD)
    if value < threshold:
        return 1 if value > 0.75 * threshold else 0
    steps = len(SCALE) - 2
    factor = max(1.6, (largest / threshold) ** (1 / steps))
    return min(2 + int(math.log(value / threshold, factor)), len(SCALE) - 1)


def heat_tone(h: Heatmap) -> Callable[[float], int]:
    """The tones of a heatmap, for its own cells and for others beside it."""
    values = np.asarray(h.values, dtype=float)
    largest = float(np.max(values, where=np.isfinite(values), initial=0.0))
    return partial(cell_tone, threshold=h.threshold, largest=largest)


def timeline_figure(t: Timeline, highlighted: set[str], tone: Callable[[float], int]) -> go.Figure:
    """The heatmap over time: a row for each joint, in the heatmap's tones."""
    values = np.array([_widest(energy) for energy in t.energy.values()])
    time = t.time[:: len(t.time) // STRIP_WINDOWS + 1]
    tones = [[tone(v) if math.isfinite(v) else None for v in row] for row in values]
    names = [_text(place.partition(":")[2] or place) for place in t.energy]
    shown = [f"<b>{n}</b>" if p in highlighted else n for n, p in zip(names, t.energy, strict=True)]
    steps = [(k, color) for i, color in enumerate(SCALE) for k in (i / len(SCALE), (i + 1) / len(SCALE))]
    fig = go.Figure(layout=plot_layout(74 + 26 * len(shown)))
    fig.add_heatmap(
        x=_small(time),
        y=shown,
        z=tones,
        zmin=-0.5,
        zmax=len(SCALE) - 0.5,
        colorscale=steps,
        showscale=False,
        ygap=2,
        customdata=_small(values),
        hovertemplate="%{y}, %{x:.2f} s: %{customdata:.2f}<extra></extra>",
    )
    if t.onset is not None:
        note = {"text": f"onset {t.onset:.2f} s", "font": {"size": 12}, "bgcolor": "#ffffff"}
        fig.add_vline(x=t.onset, line={"color": INK, "width": 2}, annotation=note)
    fig.update_xaxes(title="time [s]", zeroline=False, **AXIS)
    return fig.update_yaxes(autorange="reversed", showgrid=False, **AXIS)


def _widest(energy: np.ndarray) -> np.ndarray:
    """The largest of neighbouring windows, so that no more than `STRIP_WINDOWS` are drawn."""
    return np.maximum.reduceat(energy, np.arange(0, len(energy), len(energy) // STRIP_WINDOWS + 1))


def curve_figure(c: Curve) -> go.Figure:
    """The effect's curve over the data that it explains, or its samples where it is no function of x."""
    finite = np.flatnonzero(np.isfinite(c.x) & np.isfinite(c.y))
    if len(finite) > CURVE_POINTS:
        # A fixed seed: the picture of a diagnosis is the same each time.
        finite = np.sort(np.random.default_rng(0).choice(finite, CURVE_POINTS, replace=False))
    fig = go.Figure(layout=plot_layout(380))
    fig.add_scatter(
        x=_small(c.x[finite]),
        y=_small(c.y[finite]),
        name="data",
        mode="markers",
        marker={"color": "#6b7785", "size": 3.5, "opacity": 0.45},
        hovertemplate="%{x:.4g}, %{y:.4g}<extra></extra>",
    )
    fig.add_scatter(
        x=_small(c.fit_x),
        y=_small(c.fit_y),
        name=_text(words.effect(c.effect)),
        mode="lines" if c.is_line else "markers",
        line={"color": NAMED, "width": 3.2},
        marker={"color": NAMED, "size": 4.5, "opacity": 0.7},
        hovertemplate="%{x:.4g}, %{y:.4g}<extra></extra>",
    )
    fig.update_xaxes(title=_text(c.x_label), zeroline=True, zerolinecolor="#9aa5b1", **AXIS)
    fig.update_yaxes(title=_text(c.y_label), zeroline=True, zerolinecolor="#9aa5b1", **AXIS)
    return fig


def overlay_figure(o: Overlay, points: int, effect_label: str) -> go.Figure:
    """The signal above, its error below: measured, nominal, with the effect, runner-up; a map of an image."""
    if o.tiles is not None:
        return go.Figure(tile_figure(o, effect_label))
    shown = shown_samples(o, points)
    time, measured = _small(shown(o.time)), shown(o.measured)
    traces = [_line(time, measured, "measured", MEASURED, "solid", 2.4)]
    for name, signal, color, dash, width in (
        ("nominal model", o.nominal, NOMINAL, "dash", 1.7),
        ("runner-up", o.runner_up, RUNNER_UP, "dot", 1.4),
        (effect_label, o.with_effect, NAMED, "solid", 1.7),
    ):
        if signal is not None:
            traces.append(_line(time, shown(signal), name, color, dash, width))
            error = _line(
                time, shown(signal) - measured, name, color, "dot" if dash == "dot" else "solid", 1.3
            )
            traces.append(error | {"yaxis": "y2", "showlegend": False})
    # One figure from plain values: plotly's subplots and updates take ten times as long, for every signal.
    layout = plot_layout(470) | {
        "hovermode": "x unified",
        "xaxis": {"title": {"text": "time [s]"}, "zeroline": False, "anchor": "y2", **AXIS},
        "yaxis": {
            "title": {"text": f"{_text(words.quantity(o.quantity))} [{_text(o.unit)}]", "standoff": 6},
            "domain": [0.45, 1],
            "zeroline": False,
            **AXIS,
        },
        "yaxis2": {
            "title": {"text": "minus measured", "standoff": 6},
            "domain": [0, 0.4],
            "zerolinecolor": "#9aa5b1",
            **AXIS,
        },
    }
    return go.Figure({"data": traces, "layout": layout})


def _line(time: np.ndarray, signal: np.ndarray, name: str, color: str, dash: str, width: float) -> dict:
    return {
        "type": "scatter",
        "mode": "lines",
        "x": time,
        "y": _small(signal),
        "name": name,
        "legendgroup": name,
        "line": {"color": color, "dash": dash, "width": width},
        "hovertemplate": "%{y:.4g}",
    }


def overlay_points(overlays: tuple[Overlay, ...]) -> int:
    """How many samples each overlay may keep so that all of them stay within `OVERLAY_BYTES`."""
    arrays = 8  # time twice, four signals, up to three errors: mean of what is plotted
    return int(min(OVERLAY_POINTS, OVERLAY_BYTES / (4 * arrays * max(len(overlays), 1))))


def decimated(o: Overlay, points: int) -> np.ndarray:
    """Indices that keep the extremes of the signal and of the nominal model's error in every bucket."""
    n = len(o.time)
    if n <= points:
        return np.arange(n)
    starts = np.linspace(0, n, max(points // 4, 1) + 1).astype(int)[:-1]
    sizes = np.diff(np.append(starts, n))
    bucket = np.repeat(np.arange(len(starts)), sizes)
    keep = [np.array([0, n - 1])]
    for signal in (np.nan_to_num(o.measured), np.nan_to_num(o.nominal - o.measured)):
        order = np.lexsort((signal, bucket))  # by bucket, then by value: first is lowest, last is highest
        keep += [order[starts], order[starts + sizes - 1]]
    return np.unique(np.concatenate(keep))


def shown_samples(o: Overlay, points: int) -> Callable[[np.ndarray], np.ndarray]:
    """Function of a signal (N,) to what is drawn of it: `decimated`, and NaN between two windows.

    What was simulated over windows alone is joined by no line.
    """
    keep, steps = decimated(o, points), np.diff(o.time)
    apart = steps > BETWEEN_WINDOWS * np.median(steps) if len(steps) else steps > 0.0
    window = np.concatenate([[0], np.cumsum(apart)])
    ends = np.flatnonzero(np.diff(window[keep])) + 1
    return lambda signal: np.insert(signal[keep].astype(float), ends, np.nan)


def rms(signal: np.ndarray | None, measured: np.ndarray) -> float:
    """Root mean square of a signal's error over what is finite; NaN where nothing is."""
    if signal is None:
        return math.nan
    error = (signal - measured)[np.isfinite(signal) & np.isfinite(measured)]
    return float(np.sqrt(np.mean(error**2))) if len(error) else math.nan


def figure_json(fig: go.Figure) -> str:
    """Data and layout as JSON that can stand inside a <script> element."""
    # Only `<` can end the element or open a comment in it; JSON's escape means the same character.
    return str(fig.to_json(remove_uids=True)).replace("<", "\\u003c")


def script_json(value: object) -> str:
    """Any plain value as JSON that can stand inside a <script> element."""
    return json.dumps(value, allow_nan=False, ensure_ascii=False).replace("<", "\\u003c")


AXIS = {"gridcolor": GRID, "linecolor": "#9aa5b1", "automargin": True}


def plot_layout(height: int) -> dict:
    """Layout of a report's figure of that height [px]."""
    return {
        "template": "none",
        "height": height,
        "margin": {"l": 56, "r": 12, "t": 12, "b": 40},
        "font": {"family": FONT, "size": 12.5, "color": INK},
        "legend": {"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom", "font": {"size": 12}},
        "paper_bgcolor": "#ffffff",
        "plot_bgcolor": "#ffffff",
        "dragmode": "zoom",
    }


def _small(values: np.ndarray) -> np.ndarray:
    """Half the bytes; a screen shows three digits."""
    return np.asarray(values, dtype=np.float32)


def _text(text: str) -> str:
    """Plotly reads a few tags in its texts, so names are escaped there as well."""
    return html.escape(text, quote=False)
