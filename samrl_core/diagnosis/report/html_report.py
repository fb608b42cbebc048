"""report.html: one file without any outside part, to be shown in a meeting; verdict first.

What stands where is in `templates/`; here is what the templates show. Values are escaped by Jinja.
"""

from __future__ import annotations

import base64
import gzip
import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from jinja2 import Environment
from plotly.offline import get_plotlyjs

from samrl_core.common.templates import read_templates, sources_of
from samrl_core.diagnosis.effects import FAMILIES
from samrl_core.diagnosis.report import words
from samrl_core.diagnosis.report.figures import (
    OVERLAY_COUNT,
    SCALE,
    TEXT_LIGHT_FROM,
    cell_tone,
    curve_figure,
    figure_json,
    heat_tone,
    overlay_figure,
    overlay_points,
    rms,
    script_json,
    timeline_figure,
)
from samrl_core.diagnosis.report.seen_from import seen_from
from samrl_core.diagnosis.result import Curve, Diagnosis, Heatmap, HeldOutGap, Overlay, Signature, Timeline

TEMPLATES = Path(__file__).parent / "templates"
DISAGREE = 0.2  # of the size: measures further apart than this are remarked on
TIMELINES = 6  # at most; further recordings are left to report.json

PLAIN_VERDICT = {
    "no_gap": "Whatever difference remains is no larger than what sensors and stated tolerances explain. "
    "Nothing needs to be added to the model.",
    "effect": "The cause below explains the difference between model and machine.",
    "ambiguous": "Each of the candidates below fits about equally well. Choosing one would be a guess; ",
    "none_of_mine": "The machine differs from its model, but adding any known effect would fit for "
    "the wrong reason. What the difference looks like stands below.",
    "not_testable": "What was recorded does not show enough to tell model and machine apart.",
}


@dataclass(frozen=True)
class KeyFigure:
    """One of the row of figures below the headline."""

    title: str
    number: str
    unit: str
    note: str


@dataclass(frozen=True)
class HeatCell:
    """A cell of the heatmap."""

    shown: str
    title: str
    background: str
    color: str
    hot: bool  # significant
    hottest: bool


@dataclass(frozen=True, eq=False)
class RankedOverlay:
    """A signal and the RMS of its errors."""

    signal: Overlay
    before: float  # nominal model
    after: float  # with the effect; NaN without one


def _who_decides(d: Diagnosis) -> str:
    """End of an ambiguous verdict's sentence: a recording, where one is known that splits the candidates."""
    if d.verdict != "ambiguous":
        return ""
    return "a further recording decides." if d.next_experiment else "no recording is known that decides."


def to_html(diagnosis: Diagnosis, picture: bytes | None = None) -> str:
    """The page; `picture` is a PNG that readers see where scripts do not run (mail, previews)."""
    d = diagnosis
    named = d.effects[:2] if d.verdict == "effect" else ()
    causes = [said for e in named if (said := words.explain_family(d, e.family)).meaning]
    experiment = d.next_experiment
    places = {e.place for e in d.effects} | {w.place for w in d.where[:1]}
    left = _size_left(d)
    return (
        _environment()
        .get_template("page.html.j2")
        .render(
            d=d,
            causes=causes,
            plain_verdict=PLAIN_VERDICT[d.verdict] + _who_decides(d),
            seconds=sum(i.duration for i in d.inputs),
            key_figures=_key_figures(d),
            picture=base64.b64encode(picture).decode() if picture is not None else None,
            fits={e.name: e for e in (*d.effects, *d.runner_ups)},
            next_yaml=_yaml(experiment.programme) if experiment is not None else "",
            heat=_heat(d.heatmap) if d.heatmap is not None else None,
            timeline_json=lambda timeline: _timeline(timeline, places, d.heatmap),
            untested=_by_reason(d),
            fraction_left=left,
            reading=_two_measures(d.gap, left) if d.gap is not None and left is not None else "",
            settings=json.dumps(d.settings, indent=1, ensure_ascii=False, default=str),
            library=packed_plotly(),
            **_overlays(d),
        )
    )


@cache
def _environment() -> Environment:
    return read_templates(
        [TEMPLATES],
        words=words,
        seen_from=seen_from,
        timeline_limit=TIMELINES,
        clip=lambda fraction: min(max(fraction, 0.0), 1.0),
        source=sources_of(TEMPLATES),
        hints=_hints,
        curve_json=_curve,
    )


@cache
def packed_plotly() -> str:
    """plotly.js, packed: 2 MB in place of 5; the browser unpacks it by itself (DecompressionStream)."""
    return base64.b64encode(gzip.compress(get_plotlyjs().encode(), mtime=0)).decode()


def _hints(signature: Signature) -> list[tuple[str, float]]:
    """Strongest correlation first."""
    return sorted(signature.hints, key=lambda hint: -abs(hint[1]))


def _curve(curve: Curve) -> str:
    return figure_json(curve_figure(curve))


def _timeline(timeline: Timeline, named: set[str], heat: Heatmap | None) -> str:
    tone = heat_tone(heat) if heat is not None else partial(cell_tone, threshold=timeline.threshold)
    return figure_json(timeline_figure(timeline, named, tone))


def _yaml(value: Any) -> str:
    return yaml.safe_dump(value, sort_keys=False, allow_unicode=True)


def _by_reason(d: Diagnosis) -> dict[str, list[str]]:
    """Titles of effects that cannot be tested, by the reason."""
    found: dict[str, list[str]] = {}
    for name, reason in d.not_testable.items():
        found.setdefault(reason, []).append(FAMILIES[name].title if name in FAMILIES else name)
    return found


def _size_left(d: Diagnosis) -> float | None:
    """Fraction of the residual's size that the effects leave; the diagnosis counts its square."""
    return math.sqrt(d.unexplained_fraction) if d.unexplained_fraction >= 0 else None


def _two_measures(gap: HeldOutGap, left: float) -> str:
    """What it means that both measures agree, or do not."""
    if gap.shrink is None:
        return ""
    if gap.ends_within:
        return "What is left of the held-out gap is within tolerance: machines in order are off by as much."
    kept = 1 - gap.shrink
    if kept > left + DISAGREE:
        return (
            "The effect explains the residual better than it mends the simulation: what is left is small at "
            "every instant but adds up in motion, or the held-out recordings hold something further."
        )
    if left > kept + DISAGREE:
        return (
            "The effect mends the simulation better than it explains the residual: what is left is fast or "
            "changes its sign, so that the motion hardly shows it."
        )
    return "Both agree: what the effect leaves in the residual is what the simulation still misses."


def _key_figure(title: str, value: str, note: str = "") -> KeyFigure:
    """`value` is a number, perhaps a space and a unit."""
    # `> 99 %` stays together: its sign belongs to the number.
    number, _, unit = value.partition(" ") if value[:1] not in "<>" else (value, "", "")
    return KeyFigure(title, number, unit, note)


def _key_figures(d: Diagnosis) -> list[KeyFigure]:
    items: list[KeyFigure] = []
    gap = d.gap
    if d.effects and d.verdict == "effect":
        if gap is not None and gap.shrink is not None:
            interval = words.percent_interval(gap.ci95)
            note = "of the error re-simulated" + (f", 95 % interval {interval}" if interval else "")
            items.append(_key_figure("held-out gap shrinks by", words.percent(gap.shrink), note))
        first = d.effects[0]
        for e in d.effects[:2]:
            for name, estimate in list(e.parameters.items())[: 2 if len(d.effects) == 1 else 1]:
                note = f"95 % interval {words.interval(estimate)}"
                items.append(_key_figure(name, words.value(estimate), note))
        items.append(
            _key_figure("probability", words.probability(first.probability), "of this cause among all tried")
        )
        if gap is not None and gap.margin is not None:
            other = words.effect(gap.runner_up_effect) if gap.runner_up_effect else "the runner-up"
            items.append(_key_figure("on the runner-up", words.points(gap.margin), other))
    elif gap is not None and math.isfinite(gap.nominal):
        value = f"{words.number(gap.nominal)} {words.symbol(gap.unit)}".rstrip()
        items.append(_key_figure("held-out gap of the nominal model", value, gap.metric))
    if d.verdict == "ambiguous":
        items.append(_key_figure("candidates", str(sum(map(len, d.ambiguity_set)))))
        if d.next_experiment is not None:
            note = "probability that the proposed recording decides"
            items.append(
                _key_figure("next recording decides", words.percent(d.next_experiment.separates), note)
            )
    if math.isfinite(d.unexplained_fraction):
        after = "the named effects" if d.verdict == "effect" else "the best effect"
        note = f"of the fitted residual's energy, after {after}"
        items.append(_key_figure("unexplained", words.remainder(d.unexplained_fraction), note))
    if d.heatmap is not None and d.verdict == "no_gap":
        items.append(
            _key_figure("significant parts", str(int((d.heatmap.values >= d.heatmap.threshold).sum())))
        )
    if d.not_testable and d.verdict != "effect":
        items.append(
            _key_figure("not testable", str(len(d.not_testable)), "effects that these recordings cannot show")
        )
    return items


def _heat(h: Heatmap) -> dict[str, Any]:
    """Groups of columns, rows of cells (None: nothing observed) and the width of the first column."""
    values = np.asarray(h.values, dtype=float)
    finite = values[np.isfinite(values)]
    hottest = finite.max() if len(finite) else math.inf
    names = [name.partition(":")[2] or name for name in h.places]
    tone_of = heat_tone(h)
    rows = []
    for place, name, row in zip(h.places, names, values, strict=True):
        cells = (
            _cell(value, h.threshold, tone_of, place, column, value == hottest)
            for value, column in zip(row, h.columns, strict=True)
        )
        rows.append((name, list(cells)))
    return {
        "groups": [(channel, len(list(items))) for channel, items in groupby(h.columns, key=lambda c: c[0])],
        "rows": rows,
        "first": f"{min(0.58 * max(map(len, names), default=0) + 1.2, 15):.1f}em",
    }


def _cell(
    value: float,
    threshold: float,
    tone_of: Callable[[float], int],
    place: str,
    column: tuple[str, str],
    hottest: bool,
) -> HeatCell | None:
    if not math.isfinite(value):
        return None
    tone, hot = tone_of(value), value >= threshold
    return HeatCell(
        shown=f"{value:.1f}" if value < 99.5 else f"{value:.0f}" if value < 1e4 else f"{value:.0e}",
        title=f"{words.place(place)}, {' at '.join(column)}: {value:.2f}{', significant' if hot else ''}",
        background=SCALE[tone],
        color="#ffffff" if tone >= TEXT_LIGHT_FROM else "#1f2933",
        hot=hot,
        hottest=hottest,
    )


def _overlays(d: Diagnosis) -> dict[str, Any]:
    """Signals in the order of interest, and what the script needs to switch between them."""
    ranked = _rank(d)
    chosen = ranked[:OVERLAY_COUNT]
    points = overlay_points(tuple(o.signal for o in chosen))
    label = words.effect_label(d)
    index = []
    for i, o in enumerate(chosen):
        s = o.signal
        after = f", {label} {words.number(o.after)} {s.unit}" if math.isfinite(o.after) else ""
        error = f"RMS error of {words.quantity(s.quantity)} {words.number(o.before)} {s.unit}{after}"
        index.append(
            {
                "id": f"overlay-{i}",
                "key": [s.recording, s.joint, s.quantity],
                "caption": f"{s.recording}, {s.joint}: {error}",
            }
        )
    keys = [list(dict.fromkeys(entry["key"][k] for entry in index)) for k in range(3)]
    return {
        "overlays": chosen,
        "left_out": len(ranked) - OVERLAY_COUNT,
        "picks": {"recording": sorted(keys[0]), "joint": sorted(keys[1]), "quantity": keys[2]},
        "overlay_index": script_json(index),
        "overlay_json": lambda signal: figure_json(overlay_figure(signal, points, label)),
    }


def _rank(d: Diagnosis) -> list[RankedOverlay]:
    """The named joint first, then by nominal error as a fraction of the largest one of its quantity."""
    named = [e.place.partition(":")[2] for e in d.effects] or [w.place.partition(":")[2] for w in d.where[:1]]
    found = [RankedOverlay(o, rms(o.nominal, o.measured), rms(o.with_effect, o.measured)) for o in d.overlays]
    largest: dict[str, float] = {}
    for o in found:
        if math.isfinite(o.before):
            largest[o.signal.quantity] = max(largest.get(o.signal.quantity, 0.0), o.before)

    def rank(o: RankedOverlay) -> tuple[bool, float]:
        most = largest.get(o.signal.quantity, 0.0)
        return o.signal.joint not in named, -(
            o.before / most if math.isfinite(o.before) and most > 0 else 0.0
        )

    return sorted(found, key=rank)
