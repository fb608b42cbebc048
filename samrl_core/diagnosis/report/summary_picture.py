"""summary.png: verdict, heatmap and one overlay, for places without a browser."""

from __future__ import annotations

import math
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap, ListedColormap
from matplotlib.figure import Figure

from samrl_core.common.figure_file import picture_bytes
from samrl_core.diagnosis.report import words
from samrl_core.diagnosis.report.figures import (
    INK,
    MEASURED,
    NAMED,
    NOMINAL,
    SCALE,
    TEXT_LIGHT_FROM,
    heat_tone,
    rms,
    shown_samples,
)
from samrl_core.diagnosis.report.tile_map import SHADES, darkest, tile_maps
from samrl_core.diagnosis.result import Diagnosis, Heatmap, Overlay

WIDTH, DPI = 9.6, 125  # [inch], dots per inch
CROWDED = 10  # columns of the heatmap, above which their names are printed smaller


def to_png(diagnosis: Diagnosis) -> bytes:
    """The picture as a PNG file's bytes."""
    d = diagnosis
    overlay = _worst(d)
    rows = 0 if d.heatmap is None else len(d.heatmap.places)
    title = fill(words.headline(d), 62)
    heights = [1.05 + 0.3 * title.count("\n")]
    if rows:
        heights.append(0.9 + 0.27 * rows)
    if overlay is not None:
        heights += [2.0, 1.4] if overlay.tiles is None else [3.6]
    # Without pyplot: no global figures, no display.
    fig = Figure(figsize=(WIDTH, sum(heights)), dpi=DPI, layout="constrained", facecolor="white")
    FigureCanvasAgg(fig)
    axes = [fig.add_subplot(part) for part in fig.add_gridspec(len(heights), 1, height_ratios=heights)]
    _headline(axes.pop(0), d, title)
    if d.heatmap is not None:
        _heatmap(axes.pop(0), d.heatmap)
    if overlay is not None and overlay.tiles is not None:
        _tile_maps(axes[0], overlay, words.effect_label(d))
    elif overlay is not None:
        _overlay(axes[0], axes[1], overlay, words.effect_label(d))
    return picture_bytes(fig, metadata={"Software": None})


def _worst(d: Diagnosis) -> Overlay | None:
    named = {e.place.partition(":")[2] for e in d.effects} or {w.place.partition(":")[2] for w in d.where[:1]}
    if not d.overlays:
        return None
    quantity = d.overlays[0].quantity
    of_kind = [o for o in d.overlays if o.quantity == quantity]
    candidates = [o for o in of_kind if o.joint in named] or of_kind
    return max(candidates, key=lambda o: e if math.isfinite(e := rms(o.nominal, o.measured)) else -1.0)


def _headline(ax: Axes, d: Diagnosis, title: str) -> None:
    ax.axis("off")
    label = words.VERDICT_LABEL[d.verdict].upper()
    ax.text(0, 1, label, va="top", fontsize=10, weight="bold", color=NAMED, transform=ax.transAxes)
    text = _literal(title)
    ax.text(0, 0.78, text, va="top", fontsize=16, weight="bold", color=INK, transform=ax.transAxes)
    facts = [words.parameters(e) for e in d.effects[:2] if d.verdict == "effect"]
    if d.gap is not None and d.gap.shrink is not None and d.verdict == "effect":
        facts.append(f"held-out gap {words.change(d.gap.shrink)} ({words.percent_interval(d.gap.ci95)})")
    if math.isfinite(d.unexplained_fraction):
        facts.append(f"{words.remainder(d.unexplained_fraction)} unexplained")
    shown = fill("; ".join(filter(None, facts)) or (d.reasons[0] if d.reasons else ""), 110)
    ax.text(0, 0.0, _literal(shown), va="bottom", fontsize=10, color=INK, transform=ax.transAxes)


def _heatmap(ax: Axes, h: Heatmap) -> None:
    values = np.asarray(h.values, dtype=float)
    # Columns of phases that no recording has only take room.
    shown_columns = [j for j in range(values.shape[1]) if np.isfinite(values[:, j]).any()]
    values, columns = values[:, shown_columns], [h.columns[j] for j in shown_columns]
    tone = heat_tone(h)
    tones = np.array([[tone(v) if math.isfinite(v) else 0 for v in row] for row in values])
    ax.pcolormesh(
        tones, cmap=ListedColormap(SCALE), vmin=-0.5, vmax=len(SCALE) - 0.5, edgecolors="white", linewidth=2
    )
    for i, row in enumerate(values):
        for j, value in enumerate(row):
            light = math.isfinite(value) and tones[i, j] >= TEXT_LIGHT_FROM
            weight = "bold" if math.isfinite(value) and value >= h.threshold else "normal"
            shown = f"{value:.1f}" if math.isfinite(value) else "–"
            style: dict[str, Any] = {"color": "white" if light else INK, "weight": weight, "fontsize": 8.5}
            ax.text(j + 0.5, i + 0.5, shown, ha="center", va="center", **style)
    ax.invert_yaxis()
    ax.set_yticks(
        np.arange(len(h.places)) + 0.5, [_literal(p.partition(":")[2] or p) for p in h.places], fontsize=9
    )
    names = [_literal(f"{channel}\n{phase}") for channel, phase in columns]
    ax.set_xticks(np.arange(len(columns)) + 0.5, names, fontsize=8 if len(columns) <= CROWDED else 6.5)
    ax.xaxis.tick_top()
    ax.tick_params(length=0)
    ax.spines[:].set_visible(False)
    caption = (
        f"standard deviations of what the tolerances explain; bold: significant (above {h.threshold:.2g})"
    )
    ax.set_xlabel(caption, fontsize=8.5)


def _overlay(signal: Axes, error: Axes, o: Overlay, label: str) -> None:
    shown = shown_samples(o, 2000)
    t, measured = shown(o.time), shown(o.measured)
    signal.plot(t, measured, color=MEASURED, lw=2, label="measured")
    for name, values, color, dash in (
        ("nominal model", o.nominal, NOMINAL, "--"),
        (label, o.with_effect, NAMED, "-"),
    ):
        if values is not None:
            signal.plot(t, shown(values), dash, color=color, lw=1.3, label=name)
            error.plot(t, shown(values) - measured, color=color, lw=1)
    signal.set_ylabel(_literal(f"{words.quantity(o.quantity)} [{o.unit}]"), fontsize=9)
    signal.set_title(_literal(f"{o.recording}, {o.joint} (held out)"), fontsize=9.5, loc="left")
    signal.legend(fontsize=8.5, ncols=3, frameon=False, loc="lower right", bbox_to_anchor=(1, 0.98))
    error.set_ylabel("minus measured", fontsize=9)
    error.set_xlabel("time [s]", fontsize=9)
    for ax in (signal, error):
        ax.grid(color="#d9dee3", lw=0.7)
        ax.tick_params(labelsize=8.5)
        ax.margins(x=0.005)
        ax.spines[["top", "right"]].set_visible(False)


def _tile_maps(ax: Axes, o: Overlay, label: str) -> None:
    """Maps of the image's tiles side by side, with one scale."""
    maps = tile_maps(o, label)
    shades = LinearSegmentedColormap.from_list("error", [c for _, c in SHADES])
    drawn = None
    for k, (name, values) in enumerate(maps):
        side, left = len(values), k * (len(values) + 1.0)
        edges = np.arange(side + 1.0)
        masked = np.ma.masked_invalid(values)
        drawn = ax.pcolormesh(
            left + edges, edges, masked, cmap=shades, vmin=0.0, vmax=darkest(maps), edgecolors="#d9dee3",
            linewidth=0.5,
        )  # fmt: skip
        ax.text(left, -0.25, _literal(name), fontsize=9, va="bottom", color=INK)
    ax.set_aspect("equal", anchor="W")
    ax.invert_yaxis()
    ax.set_axis_off()
    what = f"{words.quantity(o.quantity)}: median error per tile of the image, {o.recording} (held out)"
    ax.set_title(_literal(what), fontsize=9.5, loc="left", pad=20)
    if drawn is not None and ax.figure is not None:
        ax.figure.colorbar(drawn, ax=ax, label=_literal(o.unit), shrink=0.8)


def _literal(text: str) -> str:
    """Matplotlib reads `$` as mathematics, so it is escaped."""
    return text.replace("$", r"\$")
