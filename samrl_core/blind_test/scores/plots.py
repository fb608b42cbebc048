"""Pictures of the scores: severity curve, confusion, risk against coverage, calibration, shrink, time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from samrl_core.blind_test.scores.outcome import Outcome
from samrl_core.common.figure_file import picture_bytes

INK, ACCENT, SOFT, WARN = "#1f2933", "#0b6e99", "#9fb3c8", "#c2410c"


def severity_figure(curve: Sequence[dict[str, Any]]) -> Figure:
    """Detected, family and place against severity, with Wilson intervals."""
    figure = Figure(figsize=(4.8, 3.6), layout="constrained")
    ax = figure.subplots()
    for name, label, colour in (
        ("detected", "gap detected", SOFT),
        ("place", "place right", INK),
        ("top1_family", "family right", ACCENT),
    ):
        points = [(0.5 * (c["from"] + c["to"]), c[name]) for c in curve if c[name]["trials"]]
        if not points:
            continue
        x, y = [p[0] for p in points], np.array([p[1]["value"] for p in points])
        bounds = np.array([p[1]["ci95"] for p in points]).T
        ax.errorbar(
            x,
            y,
            np.maximum(0, [y - bounds[0], bounds[1] - y]),
            color=colour,
            marker="o",
            capsize=3,
            label=label,
        )
    for c in curve:
        ax.text(
            0.5 * (c["from"] + c["to"]),
            -0.02,
            f"n {c['detected']['trials']}",
            ha="center",
            va="top",
            fontsize=7,
        )
    ax.set(
        xlim=(0, 1),
        ylim=(-0.08, 1.04),
        xlabel="severity (quantile of the effect's range)",
        ylabel="share of worlds",
    )
    if ax.get_legend_handles_labels()[0]:
        ax.legend(frameon=False, fontsize=7, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    return _plain(figure)


def confusion_figure(table: dict[str, Any]) -> Figure:
    """Counts of true family against named family or verdict."""
    counts = np.array(table["counts"], float).reshape(len(table["rows"]), len(table["columns"]))
    share = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    size = (2.6 + 0.3 * len(table["columns"]), 2.2 + 0.27 * len(table["rows"]))
    figure = Figure(figsize=size, layout="constrained")
    ax = figure.subplots()
    if share.size:
        ax.imshow(share, cmap="Blues", vmin=0, vmax=1, aspect="auto")
    for i, row in enumerate(counts):
        for j, count in enumerate(row):
            if count:
                ax.text(j, i, f"{count:.0f}", ha="center", va="center", fontsize=7,
                        color="white" if share[i, j] > 0.6 else INK)  # fmt: skip
    ax.set_xticks(range(len(table["columns"])), table["columns"], rotation=90, fontsize=7)
    ax.set_yticks(range(len(table["rows"])), table["rows"], fontsize=7)
    ax.set(xlabel="named, or verdict", ylabel="true")
    for side in ax.spines.values():
        side.set_visible(False)
    return figure


def risk_figure(table: dict[str, Any]) -> Figure:
    """Share of wrong claims when only the most certain ones count."""
    figure = Figure(figsize=(4.2, 3.2), layout="constrained")
    ax = figure.subplots()
    if table["curve"]:
        coverage, risk = np.array(table["curve"]).T
        ax.step(coverage, risk, where="post", color=ACCENT)
    ax.set(
        xlim=(0, 1),
        ylim=(0, 1),
        xlabel="share of all worlds in which a cause is named",
        ylabel="wrong among them",
    )
    return _plain(figure)


def calibration_figure(table: dict[str, Any]) -> Figure:
    """Stated probability against how often it was right."""
    figure = Figure(figsize=(3.6, 3.2), layout="constrained")
    ax = figure.subplots()
    ax.plot([0, 1], [0, 1], color=SOFT, lw=1)
    for b in table["bins"]:
        y, (low, high) = b["right"]["value"], b["right"]["ci95"]
        ax.errorbar(0.5 * (b["from"] + b["to"]), y, [[max(0, y - low)], [max(0, high - y)]], color=ACCENT,
                    marker="o", capsize=3)  # fmt: skip
    ax.set(xlim=(0, 1), ylim=(0, 1.02), xlabel="stated probability", ylabel="right (family and place)")
    return _plain(figure)


def shrink_figure(outcomes: Sequence[Outcome]) -> Figure:
    """Held-out shrink of the named effect against that of the true one, single worlds."""
    figure = Figure(figsize=(3.6, 3.2), layout="constrained")
    ax = figure.subplots()
    ax.plot([0, 1], [0, 1], color=SOFT, lw=1)
    single = [
        o for o in outcomes if o.truth.set == "single" and o.shrinks and o.shrinks.oracle_shrink is not None
    ]
    groups = (
        ("right", ACCENT, [o for o in single if o.family_right]),
        ("wrong", WARN, [o for o in single if o.primary is not None and not o.family_right]),
        ("not named", SOFT, [o for o in single if o.primary is None]),
    )
    for label, colour, part in groups:
        pairs = [(s.oracle_shrink, s.shrink if o.primary else 0.0) for o in part if (s := o.shrinks)]
        if pairs:
            ax.scatter(*zip(*pairs, strict=True), s=12, color=colour, label=f"{label} ({len(pairs)})")
            ax.legend(frameon=False, fontsize=7)
    ax.set(
        xlim=(-0.1, 1),
        ylim=(-1.02, 1),
        xlabel="shrink with the true effect",
        ylabel="shrink with the named effect",
    )
    return _plain(figure)


def family_figure(per_family: dict[str, Any]) -> Figure:
    """Top-1 share of every family with its interval."""
    order = sorted(per_family, key=lambda f: per_family[f]["value"])
    figure = Figure(figsize=(5.2, 1.2 + 0.22 * len(order)), layout="constrained")
    ax = figure.subplots()
    for k, family in enumerate(order):
        s = per_family[family]
        ax.plot(s["ci95"], [k, k], color=SOFT, lw=2)
        ax.plot(s["value"], k, "o", color=ACCENT, ms=5)
    labels = [f"{f}  {per_family[f]['successes']}/{per_family[f]['trials']}" for f in order]
    ax.set_yticks(range(len(order)), labels, fontsize=7)
    ax.set(xlim=(-0.02, 1.02), xlabel="family right, first named")
    return _plain(figure)


def png(figure: Figure) -> bytes:
    """The figure as a picture."""
    return picture_bytes(figure, dpi=130)


def _plain(figure: Figure) -> Figure:
    for ax in figure.axes:
        ax.spines[["top", "right"]].set_visible(False)
        ax.tick_params(labelsize=8)
        ax.xaxis.label.set_fontsize(8)
        ax.yaxis.label.set_fontsize(8)
    return figure
