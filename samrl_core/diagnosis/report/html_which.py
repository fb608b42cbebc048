"""The page's answer to `which`: parameters, curve, runner-ups, ambiguity, signs of an unknown cause."""

from __future__ import annotations

import yaml

from samrl_core.diagnosis.effects import FAMILIES
from samrl_core.diagnosis.report import words
from samrl_core.diagnosis.report.figures import curve_figure, figure_json
from samrl_core.diagnosis.report.html_parts import (
    Markup,
    bar,
    box,
    data_script,
    element,
    figure,
    join,
    section,
    table,
)
from samrl_core.diagnosis.result import Diagnosis, NamedEffect


def which_section(d: Diagnosis) -> Markup:
    """What was named, its curve, and all that came close."""
    if not (d.effects or d.runner_ups):
        return Markup("")
    parts: list[object] = []
    if d.effects:
        rows = [
            (
                words.effect(e.name) + (f", {e.form}" if e.form else ""),
                name,
                words.parameter(value),
                words.interval(value),
            )
            for e in d.effects
            for name, value in (e.parameters or {"–": None}).items()
            if value is not None
        ]
        parts.append(table(("effect", "parameter", "value ± 95 %", "95 % interval"), rows, numbers=(2, 3)))
    for i, curve in enumerate(d.curves):
        caption = f"{words.effect(curve.effect)}: the fitted curve over the residual that it explains"
        parts += [figure(f"curve-{i}", caption), data_script(f"curve-{i}", figure_json(curve_figure(curve)))]
    tried = [*d.effects, *d.runner_ups]
    rows = [_tried(e, e in d.effects and d.verdict == "effect") for e in tried]
    head = ("effect", "probability", "gain [nat]", "parameters")
    parts += [element("h3", "All that came close"), table(head, rows, numbers=(2,))]
    note = "Gain: how much less misfit than with the nominal model, whose uncertainty is counted."
    parts.append(element("p", note, css="note"))
    return section("Which effect", *parts, anchor="which")


def _tried(e: NamedEffect, named: bool) -> tuple[object, ...]:
    name = element("b", words.effect(e.name)) if named else words.effect(e.name)
    probability = join((bar(e.probability), words.percent(e.probability)))
    return name, probability, f"{e.gain:.1f}", words.parameters(e) or "–"


def ambiguity_section(d: Diagnosis) -> Markup:
    """What it could be, and the recording that decides."""
    if not d.ambiguity_set and d.next_experiment is None:
        return Markup("")
    known = {e.name: e for e in (*d.effects, *d.runner_ups)}
    parts: list[object] = []
    for group in d.ambiguity_set:
        cards = []
        for name in group:
            f = FAMILIES.get(name.partition("@")[0])
            fit = known.get(name)
            values = element("p", element("b", words.parameters(fit))) if fit and fit.parameters else ""
            chance = element("p", f"Probability {words.percent(fit.probability)}", css="note") if fit else ""
            cards.append(
                element(
                    "div",
                    element("h3", words.effect(name)),
                    element("p", f.meaning if f else ""),
                    values,
                    chance,
                )
            )
        parts.append(element("div", *cards, css="or"))
    if d.next_experiment is not None:
        n = d.next_experiment
        text = yaml.safe_dump(n.programme, sort_keys=False, allow_unicode=True)
        command = element(
            "p", "Play it with ", element("code", f"samrl excite {n.file}"), ", then diagnose again."
        )
        why = element("p", f"{n.why[:1].upper()}{n.why[1:].rstrip('.')}. It decides with probability ",
                      element("b", words.percent(n.separates)), ".")  # fmt: skip
        parts.append(box("The recording that decides", why, command, element("pre", text)))
    return section("What it could be" if d.ambiguity_set else "Next recording", *parts, anchor="open")


def unknown_section(d: Diagnosis) -> Markup:
    """What the unexplained rest looks like, without naming a cause."""
    parts: list[object] = []
    if d.signatures:
        rows = [
            (words.place(s.place), s.channel, what, join((bar(abs(c)), f"{c:+.2f}")))
            for s in d.signatures
            for what, c in sorted(s.hints, key=lambda hint: -abs(hint[1]))
        ]
        parts.append(element("p", "Hints about what remains, not a cause:"))
        parts.append(table(("place", "channel", "what it looks like", "correlation"), rows))
    if d.nearest is not None:
        e = d.nearest
        text = f"{words.effect(e.name)} ({words.parameters(e)}) fits best of all. Do not build on it."
        parts.append(box("Nearest effect, and it would be wrong", element("p", text)))
    return section("What the unexplained rest looks like", *parts, anchor="unknown") if parts else Markup("")
