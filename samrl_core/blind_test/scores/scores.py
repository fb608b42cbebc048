"""Every score of a blind test, each with its interval; no world leaves its denominator."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from samrl_core.blind_test.scores.effect_scores import ambiguity, intervals, localisation, two_effects
from samrl_core.blind_test.scores.outcome import CRASHED, Outcome
from samrl_core.blind_test.scores.refusal_scores import calibration, refusal, risk_and_coverage
from samrl_core.blind_test.scores.shrink_scores import shrink_scores
from samrl_core.blind_test.scores.tile_scores import bound_scores, tile_scores
from samrl_core.common.statistics import Share

MEDIAN_SEVERITY = 0.5  # quantile of the catalogue's range
SEVERITY_EDGES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
VERDICT_COLUMNS = ("no_gap", "ambiguous", "none_of_mine", "not_testable", CRASHED)


def all_scores(
    outcomes: Sequence[Outcome], left_out: Sequence[Outcome] = (), seed: int = 0
) -> dict[str, Any]:
    """Scores of the worlds diagnosed with the whole library, and of those with their family withheld."""
    rng = np.random.default_rng(seed)
    single = [o for o in outcomes if o.truth.set == "single"]
    none = [o for o in outcomes if o.truth.set == "none"]
    outside = [o for o in outcomes if o.truth.set == "outside"]
    double = [o for o in outcomes if o.truth.set == "double"]
    return {
        "worlds": {"single": len(single), "none": len(none), "outside": len(outside), "double": len(double),
                   "left_out": len(left_out)},
        "verdicts": _count(o.verdict for o in [*outcomes, *left_out]),
        "detection": detection(single, none, outside, double),
        "which": naming(single),
        "place": localisation(single),
        "refusal": refusal(single, outside, list(left_out)),
        "risk_coverage": risk_and_coverage([*outcomes, *left_out]),
        "calibration": calibration([*outcomes, *left_out]),
        "how_far": shrink_scores(single, rng),
        "intervals": intervals(single),
        "tiles": tile_scores(single),
        "bound": bound_scores(single),
        "two_effects": two_effects(double, single),
        "ambiguity": ambiguity([*single, *double]),
        "confusion": confusion([*outcomes, *left_out]),
        "severity_curve": severity_curve(single),
        "apart": apart(single, none),
        "runtime": runtime([*outcomes, *left_out]),
    }  # fmt: skip


def detection(
    single: list[Outcome], none: list[Outcome], outside: list[Outcome], double: list[Outcome]
) -> dict[str, Any]:
    """Gaps detected where there is one, and false alarms where there is none."""
    severe = [o for o in single if o.truth.severity >= MEDIAN_SEVERITY]
    usual = [o for o in none if o.truth.background_scale <= 1]
    beyond = [o for o in none if o.truth.background_scale > 1]
    return {
        "single": share(single, lambda o: o.detected),
        "single_severe": share(severe, lambda o: o.detected),
        "outside": share(outside, lambda o: o.detected),
        "double": share(double, lambda o: o.detected),
        "false_alarms": share(none, lambda o: o.alarmed),
        "false_alarms_within_tolerance": share(usual, lambda o: o.alarmed),
        "false_alarms_beyond_tolerance": share(beyond, lambda o: o.alarmed),
    }


def naming(single: list[Outcome]) -> dict[str, Any]:
    """The right family, first or among three, over all worlds and per family."""
    severe = [o for o in single if o.truth.severity >= MEDIAN_SEVERITY]
    weak = [o for o in single if o.truth.severity < MEDIAN_SEVERITY]
    named = [o for o in single if o.primary is not None]
    per_family = {
        family: share([o for o in single if o.truth.families[0] == family], lambda o: o.family_right)
        for family in sorted({o.truth.families[0] for o in single})
    }
    return {
        "top1_family": share(single, lambda o: o.family_right),
        "top1_family_severe": share(severe, lambda o: o.family_right),
        "top1_family_weak": share(weak, lambda o: o.family_right),
        "top1_family_place": share(single, lambda o: o.name_right),
        "top1_family_place_severe": share(severe, lambda o: o.name_right),
        "top3_family": share(single, lambda o: o.among_first(3)),
        "among_named": share(named, lambda o: o.family_right),
        "macro_average": float(np.mean([s["value"] for s in per_family.values()])) if per_family else None,
        "per_family": per_family,
    }


def confusion(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Rows: what was true; columns: the family named first, or the verdict that named none."""
    rows: dict[str, dict[str, int]] = {}
    for o in outcomes:
        named = o.primary["family"] if o.primary is not None else o.verdict
        row = rows.setdefault(_row(o), {})
        row[named] = row.get(named, 0) + 1
    claimed = sorted({c for row in rows.values() for c in row} - set(VERDICT_COLUMNS))
    families = sorted({o.truth.families[0] for o in outcomes if o.truth.set == "single"} | set(claimed))
    columns = [*families, *VERDICT_COLUMNS]
    order = sorted(rows, key=lambda r: (r.startswith("("), r))
    return {
        "rows": order,
        "columns": columns,
        "counts": [[rows[r].get(c, 0) for c in columns] for r in order],
    }


def severity_curve(single: list[Outcome]) -> list[dict[str, Any]]:
    """Detection and naming over five fifths of the catalogue's range."""
    curve = []
    for low, high in zip(SEVERITY_EDGES, SEVERITY_EDGES[1:], strict=False):
        last = high == SEVERITY_EDGES[-1]
        part = [o for o in single if low <= o.truth.severity and (o.truth.severity < high or last)]
        curve.append(
            {
                "from": low,
                "to": high,
                "detected": share(part, lambda o: o.detected),
                "top1_family": share(part, lambda o: o.family_right),
                "place": share(part, lambda o: o.place_right),
            }
        )
    return curve


def apart(single: list[Outcome], none: list[Outcome]) -> dict[str, Any]:
    """The main scores by engine, by form and set of the effect, by arm and by background."""
    keys: dict[str, Callable[[Outcome], str]] = {
        "engine": lambda o: o.truth.engine,
        "form": lambda o: o.truth.form,
        "set": lambda o: o.truth.series,
        "arm": lambda o: o.truth.arm,
        "background": lambda o: "within tolerance" if o.truth.background_scale <= 1 else "beyond tolerance",
    }
    tables: dict[str, Any] = {}
    for name, key in keys.items():
        table = {}
        for value in sorted({key(o) for o in [*single, *none]} - {""}):
            part = [o for o in single if key(o) == value]
            severe = [o for o in part if o.truth.severity >= MEDIAN_SEVERITY]
            table[value] = {
                "detected": share(part, lambda o: o.detected),
                "top1_family": share(part, lambda o: o.family_right),
                "top1_family_severe": share(severe, lambda o: o.family_right),
                "place": share(part, lambda o: o.place_right),
                "false_alarms": share([o for o in none if key(o) == value], lambda o: o.alarmed),
            }
        tables[name] = table
    return tables


def runtime(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Wall time of one world's diagnosis [s]."""
    seconds = [o.seconds for o in outcomes if o.seconds is not None]
    if not seconds:
        return {"n": 0}
    return {
        "n": len(seconds),
        "median_s": float(np.median(seconds)),
        "p95_s": float(np.quantile(seconds, 0.95)),
        "max_s": float(max(seconds)),
        "total_s": float(sum(seconds)),
    }


def share(outcomes: Sequence[Outcome], test: Callable[[Outcome], bool]) -> dict[str, Any]:
    """Share of the outcomes that pass, for JSON."""
    return Share.of([test(o) for o in outcomes]).as_dict()


def _row(o: Outcome) -> str:
    if o.withheld:
        return "(left out)"
    return o.truth.families[0] if o.truth.set == "single" else f"({o.truth.set})"


def _count(values: Iterable[str]) -> dict[str, int]:
    listed = list(values)
    return {v: listed.count(v) for v in sorted(set(listed))}
