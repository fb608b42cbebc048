"""Which effect first: weighed by the torque that it explains and by the motion that it explains.

The equation of torques and the simulated motion weigh the same effect differently: friction at low speed is a
small part of the torque and most of the position error; a clip of peaks is the reverse. On a machine with
several small effects beside a large one the best formula for the torque need not be what moves it otherwise.
Candidates whose equation is not much worse than the best one's are therefore simulated on the fitted
recordings, and what both leave is multiplied: two views of one cause, each a share of squared error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from samrl_core.diagnosis.residuals.observed import Observed
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, on_bound
from samrl_core.diagnosis.selection.resimulation import gap, over_time, plant_of, resimulable, resimulate

LEAST_EVIDENCE = 0.2  # of the best one's: below it a candidate is out of reach
REACH = 2.0  # times the share of the equation that the best leaves, likewise
ALIKE = 6.0  # [nat] that two formulas may differ by and be within reach of each other, whatever they leave
TIE = 0.05  # of the best evidence, likewise: what one with many free numbers gains over the thing itself
WAITING = 3  # candidates beyond reach that are tried after all within it were refused
NEXT = 0.75  # of the best evidence, that those need: what the refused ones explained is there to be explained
MOST = 6  # candidates that are simulated
OF_A_FAMILY = 2  # of them
CLEARLY = 0.75  # times what the best by evidence leaves: from here on another one goes first
SIMULATED_S = 40.0  # of recordings, at most, per comparison
MENDED = 0.03  # of the equation, that a further term must take off what the plain formula leaves
LEAST_LEFT = 0.005  # of the equation: less is noise, and no formula is so exact
CONFIRMED, DENIED = 0.8, 1.1  # shares of the squared simulated gap that are left
NO_LIMIT = 0.56  # likewise by a limit that is none: less than a quarter of the gap shrinks
MOTION = ("position", "velocity")


@dataclass(frozen=True, eq=False)
class Contender:
    """A fit with the shares of squared error that it leaves on the fitted recordings."""

    fit: Fit
    equation_left: float
    motion_left: float | None = None  # None where it cannot be simulated

    @property
    def left(self) -> float:
        """Both together; where there is no simulation, the motion counts as not explained."""
        return max(self.equation_left, LEAST_LEFT) * (1.0 if self.motion_left is None else self.motion_left)

    @property
    def on_bound(self) -> bool:
        """Whether a shape of it ended on the bound of its search."""
        return any(on_bound(h) for h in self.fit.hypotheses)


def contend(evidence: Evidence, singles: Sequence[Fit], excess: float, least: float) -> list[Contender]:
    """Candidates for the first effect, in the order in which they are tried; never empty.

    The best by evidence stays first unless another leaves clearly less. A shape on the bound of its search
    means another formula: such candidates come last. Behind all that are within reach wait the next ones,
    which are not simulated here: where what is ahead of them is refused, nearness to it says nothing.

    Args:
        evidence: of the fitted recordings.
        singles: best fit of each family and place, best first; not empty.
        excess: log likelihood [nat] that a perfect explanation would win.
        least: log evidence [nat] below which nothing is a candidate.
    """
    within = _within_reach(evidence, singles, excess)
    return [*_ranked(evidence, within, singles), *_waiting(evidence, within, singles, least)]


def _ranked(evidence: Evidence, within: list[Contender], singles: Sequence[Fit]) -> list[Contender]:
    if len(within) < 2:
        return within or [Contender(singles[0], 1.0)]
    lefts = motion_left(evidence.likelihood.trials, [c.fit for c in within])
    within = [Contender(c.fit, c.equation_left, m) for c, m in zip(within, lefts, strict=True)]
    within = in_order(within)
    inside = [c for c in within if not c.on_bound]
    if not inside:
        return within
    first, *others = inside
    better = [c for c in others if c.left < CLEARLY * first.left]
    rest = [c for c in others if c not in better]
    ranked = [*sorted(better, key=lambda c: c.left), first, *sorted(rest, key=lambda c: c.left)]
    return [*ranked, *(c for c in within if c.on_bound)]


def denied_by_motion(contenders: Sequence[Contender]) -> frozenset[str]:
    """Names of candidates that the simulated motion contradicts while it confirms the first one.

    The equation may speak for both alike: one then brings the fitted recordings' motion closer, the other
    moves it away. A limit of the drive, which takes off whatever torque there is too much of, must bring it
    closer as where it is named, and is none if it moves it away, whoever else is right.
    """
    first, *others = contenders
    confirmed = first.motion_left is not None and first.motion_left <= CONFIRMED
    return frozenset(
        c.fit.hypotheses[0].name
        for c in others
        if c.motion_left is not None
        and (
            (c.motion_left > DENIED and (confirmed or _is_limit(c.fit)))
            or (c.motion_left > NO_LIMIT and confirmed and _is_limit(c.fit))
        )
    )


def in_order(contenders: Sequence[Contender]) -> list[Contender]:
    """Those inside the bounds of their search before the others, and of them a plain family first."""
    inside = [c for c in contenders if not c.on_bound]
    return [*plain_first(inside), *(c for c in contenders if c.on_bound)] if inside else list(contenders)


def plain_first(contenders: Sequence[Contender]) -> list[Contender]:
    """The same with a family in front of the first one that contains it, where its further term only mends.

    A Stribeck drop that takes a little off what Coulomb friction leaves is the shape of the sign. Of sets
    the last member is compared; the others are the same.
    """
    first = contenders[0]
    mine = first.fit.hypotheses[-1]
    for c in contenders[1:]:
        h = c.fit.hypotheses[-1]
        if h.place != mine.place or h.effect.family not in mine.effect.contains:
            continue
        if c.equation_left < first.equation_left + MENDED and first.equation_left > 0.5 * c.equation_left:
            return [c, *(o for o in contenders if o is not c)]
    return list(contenders)


def motion_left(trials: Sequence[Observed], fits: Sequence[Fit]) -> list[float | None]:
    """Share of the squared simulated gap of motion that each fit leaves; None without a simulation."""
    out: list[float | None] = [None] * len(fits)
    arms = [t for t in trials if resimulable(t)]
    if not trials or len(arms) < len(trials):
        return out
    used, seconds = [], 0.0
    for trial in arms:
        seconds += trial.duration
        if used and seconds > SIMULATED_S:
            break
        used.append(trial)
    simulated = {str(k): fit for k, fit in enumerate(fits) if plant_of(arms[0], fit) is not None}
    if not simulated:
        return out
    runs = [resimulate(t, over_time(arms[0], simulated)) for t in used]
    nominal = gap(runs, "nominal", MOTION)
    for name in simulated:
        with_effect = gap(runs, name, MOTION)
        if np.isfinite(nominal) and nominal > 0:
            out[int(name)] = float(min(4.0, (with_effect / nominal) ** 2))
    return out


def _within_reach(evidence: Evidence, singles: Sequence[Fit], excess: float) -> list[Contender]:
    likelihood, k = evidence.likelihood, evidence.correlation_time
    out: list[Contender] = []
    families: dict[str, int] = {}
    least = LEAST_EVIDENCE * singles[0].log_evidence
    whole = max(excess, singles[0].log_evidence, 1e-9)  # tolerances may swallow what an effect explains
    for fit in singles:
        family = fit.hypotheses[0].effect.family
        if fit.log_evidence < least or len(out) == MOST:
            break
        if families.get(family, 0) == OF_A_FAMILY:
            continue
        left = likelihood.deficit(evidence.remainder(fit), k)
        left = max(left, singles[0].log_evidence - fit.log_evidence) / whole  # at least what the best adds
        # An equation that is met to the last makes nobody else impossible: no formula is so exact.
        apart = singles[0].log_evidence - fit.log_evidence
        alike = max(ALIKE, TIE * singles[0].log_evidence)
        # A limit takes off whatever torque there is too much of: what it leaves measures nobody else.
        measures = next((c.equation_left for c in out if not _is_limit(c.fit)), None)
        if measures is not None and left > REACH * max(measures, LEAST_LEFT) and apart > alike:
            continue
        families[family] = families.get(family, 0) + 1
        if not np.isfinite(fit.log_evidence):
            continue
        out.append(Contender(evidence.refine(fit, 0) if out else fit, left))
    return out


def _is_limit(fit: Fit) -> bool:
    return fit.hypotheses[0].effect.limits_motion


def _waiting(
    evidence: Evidence, within: Sequence[Contender], singles: Sequence[Fit], least: float
) -> list[Contender]:
    """The best of further families, with at least `NEXT` of the best evidence but a limit's, refined."""
    best = next((f for f in singles if not _is_limit(f)), singles[0])
    enough = max(least, NEXT * best.log_evidence)
    there = {c.fit.hypotheses[0].effect.family for c in within}
    out: list[Contender] = []
    for fit in singles[1:]:
        family = fit.hypotheses[0].effect.family
        if fit.log_evidence < enough or len(out) == WAITING:
            break
        if family not in there and np.isfinite(fit.log_evidence):
            there.add(family)
            out.append(Contender(evidence.refine(fit, 0), 1.0))
    return [c for c in out if not c.on_bound]
