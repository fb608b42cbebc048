"""How large given effects are, whether or not the recordings ask for them: to follow them over days."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.diagnosis.effects import EVERY_EFFECT, Effect
from samrl_core.diagnosis.result import NamedEffect
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit
from samrl_core.diagnosis.verdict.confidence import estimates


def checked_names(names: Sequence[str]) -> tuple[str, ...]:
    """`family@place` each.

    Raises:
        InputError: a name without a place, or of a family that no recording shows.
    """
    known = {e.family for e in EVERY_EFFECT}
    for name in names:
        family, at, place = name.partition("@")
        if not (at and place) or family not in known:
            raise InputError(
                f"cannot track {name!r}; write FAMILY@PLACE, such as coulomb_friction@joint:panda_joint4, "
                f"with a family of `samrl effects`"
            )
    return tuple(names)


def track(
    evidence: Evidence,
    chosen: Fit | None,
    names: Sequence[str],
    rng: np.random.Generator,
    effects: Sequence[Effect[Any]],
) -> tuple[tuple[NamedEffect, ...], tuple[str, ...]]:
    """Each effect beside the chosen ones, in the form and shape that fit best.

    Args:
        evidence: of the fitted recordings.
        chosen: what the diagnosis named, if anything.
        names: `family@place` of effects that are not among the chosen ones.
        rng: for the intervals.
        effects: that these recordings may show.

    Returns:
        The effects with their sizes, and a remark on each that has none: a misspelt place, say.
    """
    beside = () if chosen is None else chosen.hypotheses
    out, remarks = [], []
    for name in names:
        family, _, place = name.partition("@")
        screened = evidence.screen([e for e in effects if e.family == family])
        pool = [h for h in screened if h.place == place]
        fits = [evidence.fit([h, *(other for other in beside if other.name != name)]) for h in pool]
        best = max(
            (f for f in fits if np.isfinite(f.log_evidence)), key=lambda f: f.log_evidence, default=None
        )
        if best is not None:
            fit = evidence.refine(best, 0)
            h = fit.hypotheses[0]
            parameters = estimates(evidence, fit, 0, rng)
            gain = fit.log_evidence - (chosen.log_evidence if chosen is not None else 0.0)
            out.append(NamedEffect(family, place, math.nan, parameters, gain, h.form.name, "tracked"))
            continue
        seen = ", ".join(dict.fromkeys(h.place for h in screened)) or "no place"
        why = f"these recordings show {family} at {seen}"
        if pool:  # less friction than the model has, say
            why = f"no size that {family} may have fits these recordings there"
        remarks.append(f"{name} is not tracked: {why}")
    return tuple(out), tuple(remarks)
