"""The least size of each effect that recordings show: what a verdict of no gap leaves possible.

With G the information on an effect's amplitudes, what tolerances may do taken off it, and S their prior
covariance, the log evidence of amplitudes a is expected to be a' G C G a / 2 less what the effect costs
before the data, with C = S (S G S + I)^-1 S as in `Evidence.fit`. Where that is what a name needs, noise
decides: about every other error of that size is named. Beside it the same were nothing else off by anything,
the bound by information: what lies between the two are tolerances, which their owner may know better.

Where an effect may be one of several things (an actuator's gain of its motor or of its supply, a payload on
one axis of the flange or another), the size is that of the thing that is seen last. Where a shape stands
beside an amplitude (how far out a payload is), it is that of the middle one of the shapes that are searched.
What is there or not (a delay) has a shape for its size. Where an effect of some size takes away what it would
be seen by (light that drives colours to white), what is left must show it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.result import LeastSize
from samrl_core.diagnosis.selection.hypothesis import Evidence, Hypothesis, hypothesis, implausible
from samrl_core.diagnosis.selection.selection import SURELY, WIDE
from samrl_core.diagnosis.selection.settings import SelectionSettings

ROUNDS = 6  # in which a size grows as recordings tell less of it
SAME = 0.01  # relative, of sizes that need no further round
UNSEEN = 1e6  # times its spread before the data: an amplitude that recordings do not show at all


def least_sizes(evidence: Evidence, pool: Sequence[Hypothesis], threshold: float) -> list[LeastSize]:
    """The least size of each parameter of each effect, alone and at every place, in the library's order.

    Joints are told one by one; effects of the description are none of the machine's.

    Args:
        evidence: of the fitted recordings.
        pool: every effect at every place, form and grid shape, as `Evidence.screen` gives them.
        threshold: log evidence that a name needs [nat].
    """
    wide = None
    if not evidence.likelihood.exact:  # then a name must also stand with tolerances stated too narrow
        wide = Evidence(Likelihood(evidence.likelihood.trials, WIDE), evidence.correlation_time)
    sought = _Sought(evidence, wide, threshold)
    out: list[LeastSize] = []
    for _, at_place in groupby(filter(_is_told, pool), key=lambda h: h.name):
        forms = [list(shapes) for _, shapes in groupby(at_place, key=lambda h: id(h.form))]
        things: dict[str, list[LeastSize]] = {}
        for shapes in forms:
            things.setdefault(shapes[0].form.thing, []).extend(sought.sizes(shapes))
        own = [_nearest(sizes) for thing, sizes in things.items() if thing or len(things) == 1]
        out += pick_last(own)
    return out


def _is_told(h: Hypothesis) -> bool:
    of_all_joints = h.effect.place_kind == "joint" and h.form.place.is_arm
    return not (h.effect.of_description or of_all_joints)


def _nearest(sizes: Sequence[LeastSize]) -> list[LeastSize]:
    """Of each parameter the form that is seen first; those that nothing shows only where all are such."""
    best: dict[str, LeastSize] = {}
    for one in sizes:
        before = best.get(one.parameter)
        if before is None or _least_end(one) < _least_end(before):
            best[one.parameter] = one
    shown = [one for one in best.values() if np.isfinite([*one.stated, *one.exact]).any()]
    return shown or list(best.values())[:1]


def pick_last(things: Sequence[Sequence[LeastSize]]) -> list[LeastSize]:
    """Of each parameter that of the thing that is seen last: from there on it is seen, whichever it is.

    What another supply changes is seen from half of a motor's error, and both are an actuator's gain.
    """
    last: dict[str, LeastSize] = {}
    for one in (one for sizes in things for one in sizes):
        before, end = last.get(one.parameter), _least_end(one)
        unseen = before is None or not np.isfinite(_least_end(before))
        if unseen or (np.isfinite(end) and end > _least_end(before)):
            last[one.parameter] = one
    return list(last.values())


def _least_end(one: LeastSize) -> float:
    """The smaller, the sooner it is seen."""
    low, high = one.stated
    if low > 0.0 and np.isnan(high):
        return -low
    return min((abs(end) for end in one.stated if np.isfinite(end)), default=np.inf)


@dataclass(frozen=True)
class _Sought:
    """What a name needs in these recordings."""

    evidence: Evidence
    wide: Evidence | None
    threshold: float

    def sizes(self, shapes: Sequence[Hypothesis]) -> list[LeastSize]:
        """Of one form at all its shapes."""
        if np.any(shapes[0].mean):
            return [self._least_shape(shapes)]
        named = np.array([_amplitudes(h, self._gram(self.evidence, h), self.threshold) for h in shapes])
        # Where only what is believed before the data is searched, the best of it is found.
        alike = all(np.allclose(h.gram, shapes[0].gram) for h in shapes)
        chosen = np.argsort(named, axis=0, kind="stable")[0 if alike else (len(shapes) - 1) // 2]
        stands = {k: self._standing(shapes[k]) for k in set(chosen.tolist())}
        out = []
        for index, k in enumerate(chosen.tolist()):
            size = max(float(named[k, index]), float(stands[k][index]))
            out.append(self._of_amplitude(shapes[k], index, size))
        return [one for one in out if one is not None]

    def _gram(self, evidence: Evidence, h: Hypothesis) -> np.ndarray:
        return evidence.likelihood.tempered_gram(h.regressors, h.regressors, evidence.correlation_time)

    def _standing(self, h: Hypothesis) -> np.ndarray:
        """Amplitudes (p,) that are believed with wider tolerances too, as `selection` asks."""
        doubted = None if self.wide is None else hypothesis(self.wide.likelihood, h.effect, h.form, h.shape)
        if self.wide is None or doubted is None:
            return np.zeros(len(h.spread))
        stands = _amplitudes(h, self._gram(self.wide, doubted), SelectionSettings().wide_threshold)
        return np.minimum(stands, _amplitudes(h, self._gram(self.evidence, h), SURELY * self.threshold))

    def _of_amplitude(self, h: Hypothesis, index: int, size: float) -> LeastSize | None:
        """In the effect's own parameter and unit; None where an amplitude has none of its own."""
        trial, one = self.evidence.likelihood.trials[0], np.eye(len(h.spread))[index]
        none = h.form.parameters(trial, h.shape, 0.0 * one)
        there = h.form.parameters(trial, h.shape, h.spread * one)
        changed = [name for name, value in there.items() if value != none.get(name)]
        own = [name for name in h.form.amplitudes[index : index + 1] if name in there]
        name = next(iter([*own, *changed]), None)
        if name is None:
            return None
        least = float(_amplitudes(h, h.gram / self.evidence.correlation_time, self.threshold)[index])
        sizes = [self._still_seen(h, index, end) for end in (-size, size)]
        ends = [self._value(h, name, end * one) for end in (*sizes, -least, least)]
        larger = h.form.parameters(trial, h.shape, 2.0 * h.spread * one)[name]
        if abs(larger) < abs(there[name]):  # as a stiffness does
            ends = [ends[1], float("nan"), ends[3], float("nan")]
        return LeastSize(h.name, name, _unit(h, name), (ends[0], ends[1]), (ends[2], ends[3]))

    def _still_seen(self, h: Hypothesis, index: int, size: float) -> float:
        """A size (signed) that is seen by what recordings still tell where the effect is so large."""
        trials, one = self.evidence.likelihood.trials, np.eye(len(h.spread))[index]
        for _ in range(ROUNDS):
            left = [h.form.find_seen(t, h.shape, size * one) for t in trials]
            if all(a is b for a, b in zip(left, trials, strict=True)):
                return size
            evidence = Evidence(Likelihood(left), self.evidence.correlation_time)
            there = hypothesis(evidence.likelihood, h.effect, h.form, h.shape)
            if there is None:
                return float("inf")
            larger = float(_amplitudes(h, self._gram(evidence, there), self.threshold)[index])
            if larger <= abs(size) * (1.0 + SAME):
                return size
            size = float(np.copysign(larger, size))
        return size

    def _value(self, h: Hypothesis, name: str, amplitudes: np.ndarray) -> float:
        """A parameter; NaN where recordings do not show it, or it cannot be."""
        trial = self.evidence.likelihood.trials[0]
        seen = np.all(np.abs(amplitudes) < UNSEEN * h.spread)
        possible = h.form.is_admissible(trial, h.shape, amplitudes) and not implausible(h, trial, amplitudes)
        return h.form.parameters(trial, h.shape, amplitudes)[name] if seen and possible else float("nan")

    def _least_shape(self, shapes: Sequence[Hypothesis]) -> LeastSize:
        """Of what is there or not: its first parameter where it is just seen, between those searched."""
        trial, k = self.evidence.likelihood.trials[0], self.evidence.correlation_time
        stated, exact = [], []
        for h in shapes:
            name, value = next(iter(h.form.parameters(trial, h.shape, h.mean).items()))
            ratios = [
                _share_of_needed(h, g, self.threshold) for g in (self._gram(self.evidence, h), h.gram / k)
            ]
            stated.append((ratios[0], value))
            exact.append((max(ratios), value))
        h = shapes[0]
        return LeastSize(
            h.name, name, _unit(h, name), _where_seen(sorted(stated)), _where_seen(sorted(exact))
        )


def _amplitudes(h: Hypothesis, gram: np.ndarray, threshold: float) -> np.ndarray:
    """Amplitudes (p,) whose expected log evidence is the threshold, each alone."""
    scaled = h.spread[:, None] * gram * h.spread
    wide = scaled + np.eye(len(scaled))
    seen = np.diag(scaled @ np.linalg.solve(wide, scaled)) / h.spread**2
    return np.sqrt(2.0 * (threshold + _cost(h, wide)) / np.maximum(seen, 1e-300))


def _share_of_needed(h: Hypothesis, gram: np.ndarray, threshold: float) -> float:
    """Log evidence that amplitudes as before the data are worth, in what a name needs."""
    wide = h.spread[:, None] * gram * h.spread + np.eye(len(gram))
    return 0.5 * float(h.mean @ gram @ h.mean) / (threshold + _cost(h, wide))


def _cost(h: Hypothesis, wide: np.ndarray) -> float:
    """Log evidence [nat] that an effect costs before the data."""
    return 0.5 * float(np.linalg.slogdet(wide)[1]) + float(np.log(h.tried)) + h.cost


def _where_seen(found: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Down and up, the value at which a share, in ascending order, is one; NaN where it stays below.

    Down is what is seen from its number on downwards, as a stiffness is.
    """
    nowhere, (low, high) = float("nan"), (found[0][1], found[-1][1])
    if found[0][0] >= 1.0:
        end = low
    else:
        at = next((k for k, (share, _) in enumerate(found) if share >= 1.0), 0)
        if at == 0:
            return nowhere, nowhere
        (below, low), (above, high) = found[at - 1 : at + 1]
        part = np.log(1.0 / max(below, 1e-300)) / np.log(above / max(below, 1e-300))
        end = float(low * (high / low) ** part) if low * high > 0.0 else high
    return (end, nowhere) if low > high else (nowhere, end)


def _unit(h: Hypothesis, name: str) -> str:
    plain = name.partition("[")[0]
    return next((p.unit for p in h.effect.parameters if p.name == plain), "")
