"""report.html: one file without any outside part, to be shown in a meeting; verdict first."""

from __future__ import annotations

import base64
import gzip
import json
import math
from functools import cache

from plotly.offline import get_plotlyjs

from samrl_core.diagnosis.effects import FAMILIES
from samrl_core.diagnosis.report import words
from samrl_core.diagnosis.report.html_how_far import how_far_section
from samrl_core.diagnosis.report.html_parts import (
    Markup,
    box,
    bullets,
    element,
    join,
    key_figure,
    put,
    section,
    table,
)
from samrl_core.diagnosis.report.html_where import where_section
from samrl_core.diagnosis.report.html_which import ambiguity_section, unknown_section, which_section
from samrl_core.diagnosis.report.page_script import SCRIPT
from samrl_core.diagnosis.report.page_style import STYLE
from samrl_core.diagnosis.result import Diagnosis

# What the browser may do with the page: run what stands in it, and fetch nothing.
_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; "
    "img-src data: blob:; font-src data:"
)


def to_html(diagnosis: Diagnosis, picture: bytes | None = None) -> str:
    """The page; `picture` is a PNG that readers see where scripts do not run (mail, previews)."""
    d = diagnosis
    sections = {
        "alarms": _alarms(d),
        "open": ambiguity_section(d),
        "unknown": unknown_section(d),
        "which": which_section(d),
        "where": where_section(d),
        "far": how_far_section(d),
        "untested": _not_testable(d),
        "from": _provenance(d),
    }
    order = ["alarms", "open", "unknown", "where", "which", "far", "untested", "from"]
    if d.verdict == "not_testable":
        order.remove("untested")
        order.insert(0, "untested")
    fallback = ""
    if picture is not None:
        source = f"data:image/png;base64,{base64.b64encode(picture).decode()}"
        fallback = element("noscript", Markup(f'<img alt="{put(words.headline(d))}" src="{source}">'))
    head = join(
        (
            Markup('<meta charset="utf-8">'),
            element("title", f"{words.headline(d)} ({d.arm})"),
            Markup('<meta name="viewport" content="width=device-width, initial-scale=1">'),
            Markup(f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">'),
            Markup('<meta name="referrer" content="no-referrer"><link rel="icon" href="data:,">'),
            Markup(f"<style>{STYLE}</style>"),
        )
    )
    body = join(
        (
            _header(d),
            element("main", _key_figures(d), fallback, *(sections[name] for name in order)),
            element(
                "footer",
                element(
                    "div", f"samrl {d.version}, seed {d.seed}. The same facts for programs: report.json."
                ),
            ),
            Markup(f'<script type="text/plain" id="library">{_library()}</script>'),
            Markup(f"<script>{SCRIPT}</script>"),
        )
    )
    top = f'<!DOCTYPE html>\n<html lang="en"><head>{head}</head>'
    return f'{top}<body class="{d.verdict}">{body}</body></html>\n'


@cache
def _library() -> str:
    """plotly.js, packed: 2 MB in place of 5; the browser unpacks it by itself (DecompressionStream)."""
    return base64.b64encode(gzip.compress(get_plotlyjs().encode(), mtime=0)).decode()


def _header(d: Diagnosis) -> Markup:
    durations = sum(i.duration for i in d.inputs)
    recordings = f"{words.count(len(d.inputs), 'recording')}, {durations:.0f} s" if durations else ""
    top = element(
        "p",
        element("span", words.VERDICT_LABEL[d.verdict], css="chip"),
        ", ".join(filter(None, (f"Sim-to-real gap of {d.arm}", recordings))),
        css="eyebrow",
    )
    lead: list[object] = []
    for e in d.effects[:2] if d.verdict == "effect" else ():
        if e.family in FAMILIES:
            f = FAMILIES[e.family]
            lead.append(element("p", f.meaning, css="lead"))
            lead.append(element("p", element("b", "What to do: "), f.remedy))
    if not lead:
        lead += [element("p", _plain_verdict(d), css="lead")]
    return element("header", element("div", top, element("h1", words.headline(d)), *lead))


def _plain_verdict(d: Diagnosis) -> str:
    return {
        "no_gap": "Whatever difference remains is no larger than what sensors and stated tolerances explain. "
        "Nothing needs to be added to the model.",
        "effect": "The cause below explains the difference between model and machine.",
        "ambiguous": "Each of the candidates below fits about equally well. Choosing one would be a guess; "
        "a further recording decides.",
        "none_of_mine": "The machine differs from its model, but adding any known effect would fit for "
        "the wrong reason. What the difference looks like stands below.",
        "not_testable": "What was recorded does not show enough to tell model and machine apart.",
    }[d.verdict]


def _key_figures(d: Diagnosis) -> Markup:
    items: list[Markup] = []
    gap = d.gap
    if d.effects and d.verdict == "effect":
        if gap is not None and gap.shrink is not None:
            interval = words.percent_interval(gap.ci95)
            note = f"95 % interval {interval}" if interval else "on held-out recordings"
            items.append(key_figure("held-out gap shrinks by", words.percent(gap.shrink), note))
        first = d.effects[0]
        for e in d.effects[:2]:
            for name, estimate in list(e.parameters.items())[: 2 if len(d.effects) == 1 else 1]:
                note = f"95 % interval {words.interval(estimate)}"
                items.append(key_figure(name, words.value(estimate), note))
        items.append(
            key_figure("probability", words.percent(first.probability), "of this cause among all tried")
        )
        if gap is not None and gap.margin is not None:
            other = words.effect(gap.runner_up_effect) if gap.runner_up_effect else "the runner-up"
            items.append(key_figure("on the runner-up", words.points(gap.margin), other))
    elif gap is not None and math.isfinite(gap.nominal):
        value = f"{words.number(gap.nominal)} {words.symbol(gap.unit)}".rstrip()
        items.append(key_figure("held-out gap of the nominal model", value, gap.metric))
    if d.verdict == "ambiguous":
        items.append(key_figure("candidates", str(sum(map(len, d.ambiguity_set)))))
        if d.next_experiment is not None:
            note = "probability that the proposed recording decides"
            items.append(
                key_figure("next recording decides", words.percent(d.next_experiment.separates), note)
            )
    if math.isfinite(d.unexplained_fraction):
        note = "of the excess energy, after " + {"effect": "the named effects"}.get(
            d.verdict, "the best effect"
        )
        items.append(key_figure("unexplained", words.percent(d.unexplained_fraction), note))
    if d.heatmap is not None and d.verdict == "no_gap":
        items.append(
            key_figure("significant parts", str(int((d.heatmap.values >= d.heatmap.threshold).sum())))
        )
    if d.not_testable and d.verdict != "effect":
        items.append(
            key_figure("not testable", str(len(d.not_testable)), "effects that these recordings cannot show")
        )
    reasons = join((element("h3", "Why this verdict"), bullets(d.reasons))) if d.reasons else ""
    return join((element("dl", *items, css="figures") if items else "", reasons))


def _alarms(d: Diagnosis) -> Markup:
    # An alarm that made the verdict stands among its reasons already.
    further = [alarm for alarm in d.alarms if alarm not in d.reasons]
    return box("Alarms", bullets(further), css="alarm") if further else Markup("")


def _not_testable(d: Diagnosis) -> Markup:
    if not d.not_testable:
        return Markup("")
    by_reason: dict[str, list[str]] = {}
    for name, reason in d.not_testable.items():
        by_reason.setdefault(reason, []).append(FAMILIES[name].title if name in FAMILIES else name)
    rows = [(reason, ", ".join(names)) for reason, names in by_reason.items()]
    return section(
        "Not testable with these recordings", table(("because", "effects"), rows), anchor="not-testable"
    )


def _provenance(d: Diagnosis) -> Markup:
    rows = [
        (i.bag, i.role.replace("_", " "), f"{i.duration:.1f}", element("span", i.sha256, css="hash"))
        for i in d.inputs
    ]
    parts: list[object] = [table(("recording", "used as", "length [s]", "sha256"), rows, numbers=(2,))]
    if d.notes:
        parts += [element("h3", "Notes on the input"), bullets(d.notes)]
    if d.timings:
        spent = [(stage, f"{seconds:.1f}") for stage, seconds in d.timings.items()]
        parts += [element("h3", "Time spent"), table(("stage", "[s]"), spent, numbers=(1,), css="")]
    if d.settings:
        text = json.dumps(d.settings, indent=1, ensure_ascii=False, default=str)
        parts.append(element("details", element("summary", "Settings"), element("pre", text)))
    return section("Where this comes from", *parts, anchor="provenance")
