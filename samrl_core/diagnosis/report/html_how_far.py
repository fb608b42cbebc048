"""The page's answer to `how far`: held-out figures per channel, and signals before and after."""

from __future__ import annotations

import math

from samrl_core.diagnosis.report import words
from samrl_core.diagnosis.report.figures import (
    OVERLAY_COUNT,
    figure_json,
    overlay_figure,
    overlay_points,
    rms,
    script_json,
)
from samrl_core.diagnosis.report.html_parts import Markup, bar, data_script, element, join, section, table
from samrl_core.diagnosis.result import Diagnosis, HeldOutGap, Overlay


def how_far_section(d: Diagnosis) -> Markup:
    """The whole section, or nothing where nothing was held out."""
    parts: list[object] = []
    if d.gap is not None:
        parts += _figures(d.gap, words.effect_label(d))
    if d.overlays:
        parts.append(_overlays(d))
    if not parts:
        return Markup("")
    title = (
        "How far the gap shrinks" if d.gap and d.gap.shrink is not None else "What the nominal model misses"
    )
    return section(title, *parts, anchor="how-far")


def _figures(gap: HeldOutGap, label: str) -> list[object]:
    on = f" on {', '.join(gap.recordings)}" if gap.recordings else ""
    text = f"Re-simulated with the same commands{on}, never used for fitting. Measure: {gap.metric}."
    if gap.runner_up is not None and gap.runner_up_effect:
        text += (
            f" With the runner-up, {words.effect(gap.runner_up_effect)}, "
            f"{words.number(gap.runner_up)} {words.symbol(gap.unit)} remain."
        )
    channels = gap.channels or ((gap.metric, gap.unit, gap.nominal, gap.with_effect),)
    rows = []
    for quantity, unit, nominal, after in channels:
        shrink = 1 - after / nominal if after is not None and nominal > 0 else None
        before = join((bar(1.0, "before"), words.number(nominal)))
        rest = join((bar(after / nominal), words.number(after))) if after is not None and nominal > 0 else "–"
        rows.append((words.quantity(quantity), unit, before, rest, words.percent(shrink)))
    head = ("channel", "unit", "nominal model", label, "shrink")
    return [element("p", text), table(head, rows, numbers=(4,))]


def _overlays(d: Diagnosis) -> Markup:
    errors = {id(o): (rms(o.nominal, o.measured), rms(o.with_effect, o.measured)) for o in d.overlays}
    chosen = _ranked(d, errors)
    left_out = len(chosen) - OVERLAY_COUNT
    chosen = chosen[:OVERLAY_COUNT]
    points = overlay_points(tuple(chosen))
    index, scripts = [], []
    for i, o in enumerate(chosen):
        before, after = errors[id(o)]
        caption = (
            f"{o.recording}, {o.joint}: RMS error of {words.quantity(o.quantity)} {words.number(before)}"
        )
        caption += (
            f" {o.unit}, {words.effect_label(d)} {words.number(after)} {o.unit}"
            if math.isfinite(after)
            else f" {o.unit}"
        )
        index.append({"id": f"overlay-{i}", "key": [o.recording, o.joint, o.quantity], "caption": caption})
        scripts.append(
            data_script(f"overlay-{i}", figure_json(overlay_figure(o, points, words.effect_label(d))))
        )
    keys = [list(dict.fromkeys(entry["key"][k] for entry in index)) for k in range(3)]
    for k in (0, 1):
        keys[k].sort()
    picks = [
        element(
            "label",
            name,
            element("select", *(element("option", _shown(v), value=v) for v in values), id=f"pick-{name}"),
        )
        for name, values in zip(("recording", "joint", "quantity"), keys, strict=True)
    ]
    first = chosen[0]
    plot = element("div", css="plot", id="overlay", role="img", aria_label="measured and simulated signals")
    note = f" {words.count(left_out, 'signal')} with smaller errors are left out." if left_out > 0 else ""
    zoom = (
        "Above the signals, below what the simulations miss. With a mouse, drag to zoom and double-click "
        f"to go back.{note}"
    )
    rows = [
        (o.recording, o.joint, words.quantity(o.quantity), o.unit, *map(words.number, errors[id(o)]))
        for o in chosen
    ]
    head = ("recording", "joint", "quantity", "unit", "nominal model", words.effect_label(d))
    every = element(
        "details",
        element("summary", "RMS error of every signal shown here"),
        table(head, rows, numbers=(4, 5)),
    )
    return join(
        (
            element(
                "h3",
                "Before and after on held-out recordings" if first.with_effect is not None else "Signals",
            ),
            element("div", *picks, css="pick"),
            element(
                "figure",
                plot,
                element("figcaption", element("b", "", id="overlay-caption"), Markup("<br>"), zoom),
            ),
            every,
            *scripts,
            data_script("overlay-index", script_json(index)),
        )
    )


def _ranked(d: Diagnosis, errors: dict[int, tuple[float, float]]) -> list[Overlay]:
    """The named joint first, then by nominal error as a fraction of the largest one of its quantity."""
    named = [e.place.partition(":")[2] for e in d.effects] or [w.place.partition(":")[2] for w in d.where[:1]]
    largest: dict[str, float] = {}
    for o in d.overlays:
        before = errors[id(o)][0]
        if math.isfinite(before):
            largest[o.quantity] = max(largest.get(o.quantity, 0.0), before)

    def rank(o: Overlay) -> tuple[bool, float]:
        before = errors[id(o)][0]
        relative = (
            before / largest[o.quantity] if math.isfinite(before) and largest.get(o.quantity, 0) > 0 else 0.0
        )
        return o.joint not in named, -relative

    return sorted(d.overlays, key=rank)


def _shown(value: str) -> str:
    return words.quantity(value)
