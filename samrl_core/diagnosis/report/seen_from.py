"""From which size on effects would be seen, in words: one row an effect, however many joints it may be at."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from samrl_core.diagnosis.report import words
from samrl_core.diagnosis.result import Diagnosis, LeastSize

Ends = tuple[float, float]
MOST = 8  # families in a row


@dataclass(frozen=True)
class SeenFrom:
    """One parameter of one effect, at all places where it may be."""

    sizes: tuple[LeastSize, ...]  # at one place each

    @property
    def effect(self) -> str:
        """With its place, or how many there are."""
        if len(self.sizes) == 1:
            return words.effect(self.sizes[0].effect)
        kind = self.sizes[0].effect.partition("@")[2].partition(":")[0]
        return f"{words.effect(self.sizes[0].family)} at any of {len(self.sizes)} {kind}s"

    @property
    def parameter(self) -> str:
        """Its name."""
        return self.sizes[0].parameter

    @property
    def unit(self) -> str:
        """Of the parameter."""
        return self.sizes[0].unit

    @property
    def stated(self) -> str:
        """With tolerances as stated: from the place that shows it first to the one that shows it last."""
        return self._range([one.stated for one in self.sizes], with_places=True)

    @property
    def exact(self) -> str:
        """If nothing else were off."""
        return self._range([one.exact for one in self.sizes], with_places=False)

    @property
    def short(self) -> str:
        """`payload mass ± 0.12 kg`."""
        return f"{self.sizes[0].family} {self.parameter} {self._range([s.stated for s in self.sizes], False)}"

    def _range(self, ends: Sequence[Ends], with_places: bool) -> str:
        seen = sorted((_largest(e), k) for k, e in enumerate(ends) if any(map(math.isfinite, e)))
        if not seen:
            return "–"
        first, last = seen[0][1], seen[-1][1]
        least, most = size(ends[first], self.unit), size(ends[last], self.unit)
        place = [one.effect.partition(":")[2] for one in self.sizes]
        if least == most:
            text = least
        elif with_places:
            text = f"{size(ends[first], '1')} ({place[first]}) to {most.removeprefix('± ')} ({place[last]})"
        else:
            text = f"{size(ends[first], '1')} to {most.removeprefix('± ')}"
        unseen = [name for k, name in enumerate(place) if k not in {k for _, k in seen}]
        return f"{text}, not seen at {', '.join(unseen)}" if unseen and with_places else text


def _largest(ends: Ends) -> float:
    return max(abs(end) for end in ends if math.isfinite(end))


def size(ends: Ends, unit: str) -> str:
    """A size down and up from which on an effect is seen: `± 0.0022 m`, `-0.41 or 0.68`; a dash if none.

    What is the larger the smaller its number is (a stiffness) has an end down that is positive.
    """
    low, high = ends
    unit = f" {words.symbol(unit)}".rstrip()
    if not (math.isfinite(low) or math.isfinite(high)):
        return "–"
    if math.isclose(low, high, rel_tol=0.02):
        return f"{high:.2g}{unit}"
    if math.isclose(-low, high, rel_tol=0.02):
        return f"± {abs(high):.2g}{unit}"
    if math.isnan(high) and low > 0.0:
        return f"{low:.2g}{unit} or less"
    return " or ".join(f"{end:.2g}" for end in ends if math.isfinite(end)) + unit


def seen_from(d: Diagnosis) -> list[SeenFrom]:
    """Every effect's parameters; what is of the whole machine first, then links and joints.

    Joints that slide have rows of their own, in their own units.
    """
    grouped: dict[tuple[str, str, str, str], list[LeastSize]] = {}
    for one in d.least_sizes:
        kind = one.effect.partition("@")[2].partition(":")[0]
        grouped.setdefault((kind, one.family, one.parameter, one.unit), []).append(one)
    order = {"joint": 2, "link": 1}
    rows = sorted(grouped.items(), key=lambda item: order.get(item[0][0], 0))
    return [SeenFrom(tuple(sizes)) for _, sizes in rows]


def in_short(d: Diagnosis) -> str:
    """The first parameter of the first families that are seen at all, in a row."""
    first: dict[str, str] = {}
    for row in seen_from(d):
        if any(math.isfinite(end) for one in row.sizes for end in one.stated):
            first.setdefault(row.sizes[0].family, row.short)
    shown, more = list(first.values())[:MOST], len(first) - MOST
    return ", ".join(shown) + (f" and {more} more families" if more > 0 else "")
