"""Scores of a named effect: place, onset, parameters, second effects, ambiguity sets."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from samrl_core.blind_test.scores.outcome import Outcome
from samrl_core.common.statistics import Share

ONSET_TOLERANCE = 0.5  # [s]
_ANGLES = ("phi", "phase")  # the same after a whole turn


def localisation(single: list[Outcome]) -> dict[str, Any]:
    """Place of the claim, place of the strongest residual, and when a switched-on effect began."""
    at_joint = [o for o in single if o.truth.effects[0]["place"].startswith("joint:")]
    switched = [o for o in single if o.truth.effects[0].get("onset") is not None]
    errors = [onset_error(o) for o in switched]
    found = [e for e in errors if e is not None]
    steady = [o for o in single if o.truth.effects[0].get("onset") is None]
    return {
        "place": Share.of([o.place_right for o in single]).as_dict(),
        "where_first_joint_effects": Share.of([_where_first(o) for o in at_joint]).as_dict(),
        "onset_found": Share.of([e is not None for e in errors]).as_dict(),
        "onset_within_half_second": Share.of(
            [e is not None and e <= ONSET_TOLERANCE for e in errors]
        ).as_dict(),
        "onset_median_error_s": float(np.median(found)) if found else None,
        "onset_claimed_on_steady": Share.of([_stated_onset(o) is not None for o in steady]).as_dict(),
    }


def onset_error(o: Outcome) -> float | None:
    """Distance of stated and true onset [s]; None where none was stated."""
    stated = _stated_onset(o)
    return None if stated is None else abs(stated - float(o.truth.effects[0]["onset"]))


def _stated_onset(o: Outcome) -> float | None:
    where = o.report.get("where", ()) if o.report is not None else ()
    stated = [w for w in where if w.get("onset") is not None]
    at_place = [w for w in stated if w["place"] in {e["place"] for e in o.truth.effects}]
    chosen = at_place or stated
    return float(chosen[0]["onset"]) if chosen else None


def _where_first(o: Outcome) -> bool:
    where = o.report.get("where", ()) if o.report is not None else ()
    return bool(where) and where[0]["place"] == o.truth.effects[0]["place"]


def intervals(single: list[Outcome]) -> dict[str, Any]:
    """Whether stated 95 % intervals hold the truth: right name, form T0, the same parameter."""
    covered: list[bool] = []
    errors: list[float] = []
    per_parameter: dict[str, list[bool]] = {}
    without = 0
    for o in single:
        if not (o.name_right and o.truth.form == "T0" and o.primary is not None):
            continue
        pairs = comparable(o.primary.get("parameters", {}), o.truth.effects[0]["parameters"])
        without += not pairs
        for name, stated, true in pairs:
            inside = float(stated["ci95"][0]) <= true <= float(stated["ci95"][1])
            covered.append(inside)
            per_parameter.setdefault(f"{o.primary['family']}.{name}", []).append(inside)
            if true != 0:
                errors.append(abs(float(stated["value"]) - true) / abs(true))
    return {
        "coverage": Share.of(covered).as_dict(),
        "per_parameter": {k: Share.of(v).as_dict() for k, v in sorted(per_parameter.items())},
        "median_relative_error": float(np.median(errors)) if errors else None,
        "right_but_nothing_comparable": without,
    }


def two_effects(double: list[Outcome], single: list[Outcome]) -> dict[str, Any]:
    """Both, at least one, and second effects that are not there."""

    def hits(o: Outcome, places: bool) -> int:
        if places:
            return len({f"{e['family']}@{e['place']}" for e in o.named} & set(o.truth.names))
        left = [e["family"] for e in o.named]
        count = 0
        for family in o.truth.families:  # twice the same family needs to be named twice
            if family in left:
                left.remove(family)
                count += 1
        return count

    return {
        "both_families": Share.of([hits(o, False) == len(o.truth.effects) for o in double]).as_dict(),
        "both_with_place": Share.of([hits(o, True) == len(o.truth.effects) for o in double]).as_dict(),
        "at_least_one": Share.of([hits(o, False) >= 1 for o in double]).as_dict(),
        "spurious_second_on_singles": Share.of([len(o.named) > 1 for o in single]).as_dict(),
    }


def ambiguity(known: list[Outcome]) -> dict[str, Any]:
    """Whether the sets of `ambiguous` verdicts hold a true cause, and how large they are."""
    ambiguous = [o for o in known if o.verdict == "ambiguous" and o.report is not None]
    groups = [
        [name for group in (o.report or {}).get("ambiguity_set", ()) for name in group] for o in ambiguous
    ]
    families = [{n.split("@")[0] for n in g} for g in groups]
    sizes = [len(set(g)) for g in groups]
    return {
        "ambiguous": Share.of([o.verdict == "ambiguous" for o in known]).as_dict(),
        "coverage": Share.of(
            [bool(set(o.truth.names) & set(g)) for o, g in zip(ambiguous, groups, strict=True)]
        ).as_dict(),
        "coverage_family": Share.of(
            [bool(set(o.truth.families) & f) for o, f in zip(ambiguous, families, strict=True)]
        ).as_dict(),
        "median_size": float(np.median(sizes)) if sizes else None,
        "sizes": sorted(sizes),
    }


def comparable(stated: Mapping[str, Any], true: Mapping[str, Any]) -> list[tuple[str, Any, float]]:
    """(name, stated estimate, true value) of scalar parameters with an interval.

    A parameter must have the same name and unit in both. What is parametrised unlike (a link's mass error
    against its first moment, say) is left out. An angle's truth is turned to the estimate's side.
    """
    values = {
        name: float(known["value"])
        for name, known in true.items()
        if isinstance(known, dict) and isinstance(known.get("value"), int | float)
    }
    pairs = []
    for name, estimate in stated.items():
        if None in (estimate.get("ci95") or (None, None)):
            continue
        if name not in values or _unit(true[name]) != _unit(estimate):
            continue
        value = values[name]
        if name in _ANGLES:
            value += math.tau * round((float(estimate["value"]) - value) / math.tau)
        pairs.append((name, estimate, value))
    return pairs


def _unit(quantity: Mapping[str, Any]) -> str:
    """Radians are pure numbers where something is counted per angle."""
    return {"1/rad": "1"}.get(str(quantity.get("unit")), str(quantity.get("unit")))
