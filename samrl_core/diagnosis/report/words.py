"""Words and numbers shared by all forms of the report, so that they all say the same thing."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

from samrl_core.common.errors import InputError
from samrl_core.diagnosis.effects import FAMILIES, Effect, find_family
from samrl_core.diagnosis.result import (
    Diagnosis,
    FamilyWords,
    HeldOutGap,
    NamedEffect,
    NextExperiment,
    ParameterEstimate,
)

VERDICT_LABEL = {
    "no_gap": "No gap",
    "effect": "Cause found",
    "ambiguous": "Ambiguous",
    "none_of_mine": "Unknown cause",
    "not_testable": "Not testable",
}

LOPSIDED = 1.5  # one arm of an interval by the other, from which on `±` would not be the interval
LEAST_CHANCE = 0.001  # that is told apart from none
QUANTITY = {"commanded_effort": "commanded effort"}


def headline(d: Diagnosis) -> str:
    """The verdict as one sentence."""
    match d.verdict:
        case "no_gap":
            return "Model and machine agree within the stated tolerances"
        case "effect":
            first, *more = (find_family(e.family) for e in d.effects)
            titles = [first.title, *(f.running_title for f in more)]
            causes = [f"{t} at {place(e.place)}" for t, e in zip(titles, d.effects, strict=True)]
            return f"{_join(causes, 'and')} {'causes' if len(causes) == 1 else 'cause'} the gap"
        case "ambiguous":
            names = [name for group in d.ambiguity_set for name in group]
            return f"There is a gap with {len(names)} possible causes that these recordings cannot tell apart"
        case "none_of_mine":
            return "There is a gap, and no effect in the library explains it"
        case "not_testable":
            return "These recordings cannot answer the question"
    raise InputError(f"unknown verdict {d.verdict!r}")


def place(name: str) -> str:
    """`joint:panda_joint4` as it is spoken: joint panda_joint4."""
    kind, colon, rest = name.partition(":")
    return f"{kind} {rest}" if colon else f"the {name}"


def effect(name: str) -> str:
    """`backlash@joint:j4` as it is spoken: backlash at joint j4. Unknown families keep their name."""
    head, at, where = name.partition("@")
    title = FAMILIES[head].title if head in FAMILIES else head.replace("_", " ")
    return f"{title} at {place(where)}" if at else title


def parameter(estimate: ParameterEstimate) -> str:
    """Value with its 95 % interval and unit, to the digits that the interval supports.

    Half the interval behind `±` where the value stands in its middle; both ends where it does not.
    """
    unit = _scale(estimate)[1]
    unit = f" {unit}" if unit else ""
    return f"{_figure(estimate)}{_spread(estimate)}{unit}"


def _figure(estimate: ParameterEstimate) -> str:
    """The value without its unit."""
    by, half = _scale(estimate)[0], _half_width(estimate)
    value = by * estimate.value
    if not (math.isfinite(half) and half > 0):
        return number(value)
    if _decimals(half, 2) > 6 or abs(value) >= 1e6:
        return f"{value:.3g}"
    return f"{value:.{max(_decimals(half, 2), 0)}f}"


def _spread(estimate: ParameterEstimate) -> str:
    """What stands behind the value: ` ± 0.031`, or ` [0.006, 0.060]`; nothing where no interval is."""
    half = _half_width(estimate)
    if not (math.isfinite(half) and half > 0):
        return ""
    low, high = estimate.value - estimate.ci95[0], estimate.ci95[1] - estimate.value
    if max(low, high) > LOPSIDED * min(low, high):  # so is a value outside its interval
        return f" {interval(estimate)}"
    if _decimals(half, 2) > 6 or abs(_scale(estimate)[0] * estimate.value) >= 1e6:
        return f" ± {half:.2g}"
    return f" ± {half:.{max(_decimals(half, 2), 0)}f}"


def _half_width(estimate: ParameterEstimate) -> float:
    """Half the interval, in the unit that is shown."""
    return _scale(estimate)[0] * (estimate.ci95[1] - estimate.ci95[0]) / 2


def _scale(estimate: ParameterEstimate) -> tuple[float, str]:
    """What a number is shown times, and the unit behind it: small pure numbers are parts per million."""
    half = (estimate.ci95[1] - estimate.ci95[0]) / 2
    small = estimate.unit == "1" and 0 < half < math.inf and _decimals(half, 2) > 6
    return (1e6, "ppm") if small else (1.0, symbol(estimate.unit))


def value(estimate: ParameterEstimate) -> str:
    """The value alone with its unit, to the digits that the interval supports."""
    return f"{_figure(estimate)} {_scale(estimate)[1]}".rstrip()


def interval(estimate: ParameterEstimate) -> str:
    """The 95 % interval in brackets."""
    low, high = (_scale(estimate)[0] * end for end in estimate.ci95)
    half = (high - low) / 2
    if not (math.isfinite(half) and half > 0):
        return f"[{number(low)}, {number(high)}]"
    digits = max(_decimals(half, 2), 0)
    if digits > 6:
        return f"[{low:.4g}, {high:.4g}]"
    return f"[{low:.{digits}f}, {high:.{digits}f}]"


def parameters(e: NamedEffect) -> str:
    """All parameters of an effect in a row."""
    return ", ".join(f"{name} = {parameter(value)}" for name, value in e.parameters.items())


def explain_family(d: Diagnosis, name: str) -> FamilyWords:
    """What is said of an effect or a family by its name, where such recordings show it; empty if unknown."""
    family = name.partition("@")[0]
    if family in d.told:
        return d.told[family]
    if family not in FAMILIES:
        return FamilyWords("", "")
    one = FAMILIES[family]
    return FamilyWords(one.meaning, one.remedy, one.explained if isinstance(one, Effect) else {})


def meaning(d: Diagnosis, e: NamedEffect, name: str) -> str:
    """What a parameter of an effect is, such as its frame; empty where nothing is said of it."""
    return explain_family(d, e.family).parameters.get(name, "")


def percent(fraction: float | None) -> str:
    """A fraction as per cent; an en dash where there is none. Never rounds to an untrue 0 or 100."""
    if fraction is None or not math.isfinite(fraction):
        return "–"
    if 0.995 <= fraction < 1:
        return "> 99 %"
    if 0 < fraction <= 0.005:
        return "< 1 %"
    return f"{round(100 * fraction)} %"  # an integer: a float may be -0


def change(shrink: float) -> str:
    """What a gap does that is smaller by this fraction, or larger where it is negative."""
    if round(100 * shrink) == 0:
        return "does not shrink"
    return f"shrinks by {percent(shrink)}" if shrink > 0 else f"grows by {percent(-shrink)}"


def say_kept(gap: HeldOutGap) -> str:
    """What an effect leaves of a gap, as per cent; a share of what is within tolerance says little alone."""
    share = percent(None if gap.shrink is None else 1.0 - gap.shrink)
    return f"{share} (within tolerance)" if gap.ends_within else share


def probability(value: float | None) -> str:
    """A probability among what was tried, as per cent; never a certainty, which no recording gives."""
    return percent(None if value is None else min(max(value, LEAST_CHANCE), 1.0 - LEAST_CHANCE))


def remainder(fraction: float | None) -> str:
    """A share that stays unexplained, as per cent; never none, as what lies below noise is not seen."""
    return percent(None if fraction is None else max(fraction, LEAST_CHANCE))


def percent_interval(ci: tuple[float, float] | None) -> str:
    """`79 to 86 %`, or nothing."""
    if ci is None or not all(map(math.isfinite, ci)):
        return ""
    return f"{round(100 * ci[0])} to {round(100 * ci[1])} %"


def points(difference: float | None) -> str:
    """A difference of two fractions in percentage points, signed."""
    if difference is None or not math.isfinite(difference):
        return "–"
    whole = round(100 * difference)
    return f"{whole:+d} points" if whole else "0 points"


def number(value: float | None) -> str:
    """Three significant digits; an en dash where there is no finite number."""
    return "–" if value is None or not math.isfinite(value) else f"{value:.3g}"


def beside(d: Diagnosis) -> list[NamedEffect]:
    """Effects that are there whichever of the candidates is: each explains what none of those can."""
    open_ = {name for group in d.ambiguity_set for name in group}
    return [e for e in d.effects if open_ and e.role == "secondary" and e.name not in open_]


def symbol(unit: str) -> str:
    """A unit as it is written behind a number: nothing for pure numbers."""
    return "" if unit == "1" else unit


def effect_label(d: Diagnosis) -> str:
    """What the simulation with an effect is called: only a verdict of `effect` names one."""
    named = "with the named effects" if len(d.effects) > 1 else "with the named effect"
    labels = {"effect": named, "ambiguous": "with the likeliest candidate"}
    return labels.get(d.verdict, "with the nearest effect")


def count(n: int, noun: str) -> str:
    """`1 recording`, `2 recordings`."""
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


def record_with(experiment: NextExperiment) -> str:
    """How the next recording is made: by the simulated cell's arms, or by hand as its file says."""
    return f"{'samrl excite' if 'arm' in experiment.programme else 'record as in'} {experiment.file}"


def quantity(name: str) -> str:
    """The name of a recorded quantity as it is spoken."""
    return QUANTITY.get(name, name)


def grouped(sentences: Iterable[str]) -> list[tuple[str, list[str]]]:
    """Sentences that say the same of different things together: the first of each kind, and all the others.

    Two are of a kind when they differ in numbers, in effects and in what stands before a colon only.
    """
    kinds: dict[str, list[str]] = {}
    for sentence in sentences:
        subject, colon, rest = sentence.partition(": ")
        kind = re.sub(r"\w+@\S+|[-+]?\d[\w.,+-]*", "*", rest if colon else subject)
        kinds.setdefault(kind, []).append(sentence)
    return [(alike[0], alike[1:]) for alike in kinds.values()]


def _decimals(value: float, significant: int) -> int:
    """Decimals that show so many significant digits of a positive value."""
    return significant - 1 - math.floor(math.log10(value))


def _join(names: list[str], word: str) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {word} {names[-1]}"
