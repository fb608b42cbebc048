"""The page's answer to `where`: heatmap as a table that needs no script, parts of recordings, timelines."""

from __future__ import annotations

import math
from itertools import groupby

import numpy as np

from samrl_core.diagnosis.report import words
from samrl_core.diagnosis.report.figures import figure_json, timeline_figure
from samrl_core.diagnosis.report.html_parts import (
    Markup,
    bar,
    data_script,
    element,
    figure,
    join,
    section,
    table,
)
from samrl_core.diagnosis.result import Diagnosis, Heatmap, Timeline

TIMELINES = 6  # at most; further recordings are left to report.json

# ColorBrewer's YlOrRd without its darkest tones, so that dark figures stay readable on the first four.
SCALE = ("#ffffff", "#fff3c4", "#fed976", "#feb24c", "#fd8d3c", "#c8301b", "#8f0d24")
TEXT_LIGHT_FROM = 5


def where_section(d: Diagnosis) -> Markup:
    """The whole section, or nothing where there was nothing to look at."""
    parts: list[object] = []
    if d.heatmap is not None:
        parts.append(_heatmap(d.heatmap))
    if d.where:
        parts += [element("h3", "Strongest parts of the recordings"), _where_table(d)]
    if d.timelines:
        parts += [element("h3", "Over time"), _timelines(d)]
    if d.couplings:
        rows = [(a, b, words.quantity(q), f"{c:+.2f}") for a, b, q, c in d.couplings]
        head = ("joint", "moves with", "through", "correlation")
        parts += [element("h3", "Coupled joints"), table(head, rows, numbers=(3,))]
    return section("Where the gap lies", *parts, anchor="where") if parts else Markup("")


LEAST_THRESHOLD = 1e-3  # standard deviations; where all quiet cells are exactly zero


def cell_tone(value: float, threshold: float) -> int:
    """Which colour a cell gets: below the threshold pale, then one step for every factor of 1.6."""
    threshold = max(threshold, LEAST_THRESHOLD)
    if value < threshold:
        return 1 if value > 0.75 * threshold else 0
    return min(2 + int(math.log(value / threshold, 1.6)), len(SCALE) - 1)


def _heatmap(h: Heatmap) -> Markup:
    groups = [(channel, len(list(items))) for channel, items in groupby(h.columns, key=lambda c: c[0])]
    top = element(
        "tr", element("td"), *(element("th", name, colspan=n, scope="colgroup") for name, n in groups)
    )
    second = element("tr", element("td"), *(element("th", phase, scope="col") for _, phase in h.columns))
    finite = np.asarray(h.values, dtype=float)[np.isfinite(h.values)]
    hottest = finite.max() if len(finite) else math.inf
    rows = []
    for name, values in zip(h.places, np.asarray(h.values, dtype=float), strict=True):
        head = element("th", name.partition(":")[2] or name, scope="row")
        cells = (
            _cell(value, h.threshold, name, column, value == hottest)
            for value, column in zip(values, h.columns, strict=True)
        )
        rows.append(element("tr", head, *cells))
    longest = max((len(name.partition(":")[2] or name) for name in h.places), default=0)
    first = f"{min(0.58 * longest + 1.2, 15):.1f}em"
    columns = element("colgroup", Markup(f'<col style="width:{first}">' + "<col>" * len(h.columns)))
    width = f"min-width:calc({first} + {54 * len(h.columns)}px)"
    body = element(
        "table", columns, element("thead", top, second), element("tbody", *rows), css="heat", style=width
    )
    caption = (
        f"Residual in standard deviations of what sensors and stated tolerances explain (1 is expected). "
        f"Framed cells exceed {h.threshold:.2g}, significant after false-discovery control; "
        f"– means that nothing was observed."
    )
    scroll = element(
        "div", body, css="scroll", tabindex=0, role="region", aria_label="joints by channel and phase"
    )
    return element("figure", scroll, element("figcaption", caption))


def _cell(value: float, threshold: float, place: str, column: tuple[str, str], hottest: bool) -> Markup:
    if not math.isfinite(value):
        return element("td", "–", css="none")
    tone = cell_tone(value, threshold)
    color = "#ffffff" if tone >= TEXT_LIGHT_FROM else "#1f2933"
    shown = f"{value:.1f}" if value < 99.5 else f"{value:.0f}" if value < 1e4 else f"{value:.0e}"
    style = f"background:{SCALE[tone]};color:{color}"
    hot = value >= threshold
    title = f"{words.place(place)}, {column[0]} at {column[1]}: {value:.2f}{', significant' if hot else ''}"
    mark = "" if hottest else None
    return element("td", shown, style=style, css="hot" if hot else None, title=title, data_hottest=mark)


def _where_table(d: Diagnosis) -> Markup:
    rows = [
        (
            words.place(w.place),
            w.channel,
            w.phase,
            w.recording or "–",
            f"{w.t0:.2f} to {w.t1:.2f}" + (f", since {w.onset:.2f}" if w.onset is not None else ""),
            join((bar(w.share), words.percent(w.share))),
        )
        for w in d.where
    ]
    return table(("place", "channel", "phase", "recording", "time [s]", "share of the excess"), rows)


def _timelines(d: Diagnosis) -> Markup:
    named = {e.place for e in d.effects} | {w.place for w in d.where[:1]}
    parts: list[object] = []
    for i, timeline in enumerate(d.timelines[:TIMELINES]):
        caption = f"{timeline.recording}: residual per window in standard deviations"
        if timeline.onset is not None:
            caption += f"; the gap begins at {timeline.onset:.2f} s"
        parts += [figure(f"timeline-{i}", caption), _data(f"timeline-{i}", timeline, named)]
    if (left := len(d.timelines) - TIMELINES) > 0:
        parts.append(element("p", f"{words.count(left, 'further recording')} in report.json.", css="note"))
    return join(parts)


def _data(anchor: str, timeline: Timeline, named: set[str]) -> Markup:
    return data_script(anchor, figure_json(timeline_figure(timeline, named)))
