"""The ten lines that the terminal shows: verdict first, then where, which, how far, and what is left open."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import wrap

from samrl_core.diagnosis.effects import FAMILIES
from samrl_core.diagnosis.report import words
from samrl_core.diagnosis.report.seen_from import in_short
from samrl_core.diagnosis.result import GAPS, Diagnosis, HeldOutGap

LINES = 10
WIDTH = 110
INDENT = 15
NOT_TRACKED = " is not tracked: "  # in notes of the tracking
OF_DESCRIPTION = ("this log fits if", "beside it ")  # an error of it, and the gap that it leaves
OF_MOTION = ("nor would it", "tolerances off")  # shrink, were the named effect all there is; without one
OF_DOUBT = (
    "turn otherwise",
    "stand apart",
    "stand elsewhere",
    "counts as zero",
)  # notes that no verdict counts


def summary(diagnosis: Diagnosis, files: Sequence[str] = ()) -> list[str]:
    """At most ten plain lines of at most 110 characters; `files` are the names of what was written."""
    d = diagnosis
    lines = [f"{words.VERDICT_LABEL[d.verdict].upper()}: {words.headline(d)}."]
    lines += _where(d)
    if d.verdict == "effect":
        lines += _which(d)
        lines += [_line("why", reason) for reason in d.reasons[:2] if reason.startswith(OF_DESCRIPTION)]
    elif d.reasons:
        lines.append(_line("why", d.reasons[0]))
    if d.ambiguity_set:
        lines.append(_line("could be", " or ".join(_candidate(d, name) for name in d.ambiguity_set[0])))
    lines += [_line("beside it", _candidate(d, e.name)) for e in words.beside(d)]
    if d.gap is not None:
        lines.append(_line("how far", _how_far(d.gap, named=d.verdict != "no_gap")))
        lines += [_line("but", reason) for reason in d.reasons if any(s in reason for s in OF_MOTION)]
    if d.verdict == "no_gap" and d.least_sizes:
        lines.append(_line("seen from", f"{in_short(d)}, each alone; less passes"))
    if d.verdict in GAPS:
        left = words.remainder(d.unexplained_fraction)
        best = {"effect": "the named", "ambiguous": "the candidate", "none_of_mine": "the best-fitting"}[
            d.verdict
        ]
        noun = "effects" if len(d.effects) > 1 else "effect"
        # Fitted samples beyond noise and tolerances; motion that was never fitted. Neither says the other.
        other = ""
        if d.gap is not None and d.gap.shrink is not None:
            other = f", {words.say_kept(d.gap)} of the held-out gap"
        text = f"{left} of the excess energy remains with {best} {noun}{other}"
        lines.append(_line("unexplained", text))
    if d.nearest is not None:
        lines.append(_line("nearest", f"{words.effect(d.nearest.name)}, but it would be wrong"))
    if d.verdict == "none_of_mine" and d.signatures and d.signatures[0].hints:
        s = d.signatures[0]
        hint, correlation = max(s.hints, key=lambda item: abs(item[1]))
        lines.append(
            _line("looks like", f"{hint} ({correlation:+.2f}) at {words.place(s.place)}, {s.channel}")
        )
    if d.next_experiment is not None:
        n = d.next_experiment
        lines.append(
            _line(
                "next", f"{words.record_with(n)} ({words.percent(n.separates)} sure to split them): {n.why}"
            )
        )
    if alarms := [alarm for alarm in d.alarms if alarm not in d.reasons[:1]]:  # the first stands under "why"
        lines.append(_line("alarm", _first_of(alarms)))
    if d.verdict in ("no_gap", "none_of_mine"):
        lines += [_line("note", note) for note in d.notes if any(word in note for word in OF_DOUBT)][:1]
    if d.verdict == "not_testable":  # then the list says nothing that the reason does not
        lines.append(
            _line("not testable", f"{len(d.not_testable)} families of effects; report.html says why each")
        )
    elif d.not_testable:
        names = ", ".join(FAMILIES[f].title if f in FAMILIES else f for f in d.not_testable)
        lines.append(_line("not testable", f"{len(d.not_testable)}: {names}"))
    tail = [_line("files", _in_one_folder(files))] if files else []
    return _fit(lines[: LINES - len(tail)] + tail)


def tracked(diagnosis: Diagnosis) -> list[str]:
    """A line for each effect whose size was asked for and that is not named: its size, or why it has none."""
    sizes = [_line("tracked", f"{e.name}: {words.parameters(e)}") for e in diagnosis.tracked]
    return [*sizes, *(_line("note", note) for note in diagnosis.notes if NOT_TRACKED in note)]


def _where(d: Diagnosis) -> list[str]:
    if not d.where:
        return []
    w = d.where[0]
    onset = f", since {w.onset:.2f} s" if w.onset is not None else ""
    more = f"; {words.count(len(d.where) - 1, 'weaker place')} in the report" if len(d.where) > 1 else ""
    share = f"{words.percent(w.share)} of the excess"
    text = f"{words.place(w.place)}, {w.channel} at {w.phase}: {share}{onset}{more}"
    return [_line("where", text)]


def _which(d: Diagnosis) -> list[str]:
    lines = []
    for e in d.effects[:3]:
        values = words.parameters(e) or "no parameters"
        chance = f"probability {words.probability(e.probability)}{_next(d)}"
        lines.append(_line("which", f"{e.name}, {chance}: {values}"))
    return lines


def _next(d: Diagnosis) -> str:
    """The likeliest rival's probability, where the named cause has less than half: many share the rest."""
    if len(d.effects) != 1 or d.effects[0].probability >= 0.5 or not d.runner_ups:
        return ""
    likeliest = max(r.probability for r in d.runner_ups)
    return f" among all that were tried, no rival's above {words.probability(likeliest)}"


def _candidate(d: Diagnosis, name: str) -> str:
    """A cause that cannot be told from others, with the size that it would have."""
    found = next((e for e in (*d.effects, *d.runner_ups) if e.name == name), None)
    sizes = "" if found is None else words.parameters(found)
    return f"{words.effect(name)} ({sizes})" if sizes else words.effect(name)


def _in_one_folder(files: Sequence[str]) -> str:
    """Files by their names, behind the folder that holds them all; else as they are."""
    folders = {file.rpartition("/")[0] for file in files}
    if len(folders) > 1 or folders == {""}:
        return "  ".join(files)
    (folder,) = folders
    return f"in {folder}: {', '.join(file.rpartition('/')[2] for file in files)}"


def _how_far(gap: HeldOutGap, named: bool = True) -> str:
    """The gap and what the effect makes of it; the gap alone where none is `named`."""
    unit = words.symbol(gap.unit)
    before = words.number(gap.nominal)
    if gap.shrink is None or not named:
        return f"{before} {unit} {gap.metric} on held-out recordings".replace("  ", " ")
    interval = f" ({ci})" if (ci := words.percent_interval(gap.ci95)) else ""
    if interval and round(100 * gap.shrink) <= 0:  # else it would be read as an interval of the growth
        interval = f" (95 % interval of its shrink {ci})"
    margin = f"; {words.points(gap.margin)} on the runner-up" if gap.margin is not None else ""
    value = f"{before} -> {words.number(gap.with_effect)} {unit}".rstrip()
    return f"held-out gap {words.change(gap.shrink)}{interval}{margin} ({gap.metric} {value})"


def _first_of(items: Sequence[str]) -> str:
    return items[0] + (f" (and {len(items) - 1} more)" if len(items) > 1 else "")


def _line(label: str, text: str) -> str:
    return f"  {label:<{INDENT - 2}}{text}"


def _fit(lines: list[str]) -> list[str]:
    """Long lines are continued while lines are left, first things first, and cut after that."""
    spare = LINES - len(lines)
    result = []
    for line in lines:
        clean = "".join(c if c.isprintable() else " " for c in line)
        parts = wrap(
            clean, WIDTH, subsequent_indent=" " * INDENT, drop_whitespace=True, break_on_hyphens=False
        )
        used = min(spare, len(parts) - 1)
        spare -= used
        result += parts[:used]
        rest = parts[used] if used == len(parts) - 1 else _continued(parts[used:])
        result.append(rest)
    return result


def _continued(parts: list[str]) -> str:
    """What is left of a line, cut to the width."""
    text = f"{parts[0]} {' '.join(part.strip() for part in parts[1:])}"
    return text[: WIDTH - 3].rstrip() + "..."
