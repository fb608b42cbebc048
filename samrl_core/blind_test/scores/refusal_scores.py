"""Scores of saying no: unknown causes refused, known ones not, probabilities that mean something."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from samrl_core.blind_test.scores.outcome import Outcome
from samrl_core.common.statistics import (
    Share,
    auroc,
    brier_score,
    expected_calibration_error,
    rejected_share,
    risk_coverage,
)


def refusal(single: list[Outcome], outside: list[Outcome], left_out: list[Outcome]) -> dict[str, Any]:
    """Unknown worlds (outside the library, or with their family withheld) against known ones."""
    unknown = [*outside, *left_out]
    known = [o.unknown_score for o in single]

    def rejected(part: list[Outcome]) -> dict[str, Any]:
        return Share.of([o.verdict == "none_of_mine" for o in part]).as_dict()

    return {
        "unknown_rejected": rejected(unknown),
        "outside_rejected": rejected(outside),
        "left_out_rejected": rejected(left_out),
        "unknown_not_seen": Share.of([o.verdict == "no_gap" for o in unknown]).as_dict(),
        "unknown_named": Share.of([o.verdict == "effect" for o in unknown]).as_dict(),
        "unknown_rejected_among_seen": rejected([o for o in unknown if o.detected]),
        "known_refused": rejected(single),
        "unknown_rejected_at_5_percent": rejected_share([o.unknown_score for o in unknown], known).as_dict(),
        "auroc": auroc([o.unknown_score for o in unknown], known),
        "auroc_among_seen": auroc(
            [o.unknown_score for o in unknown if o.detected], [o.unknown_score for o in single if o.detected]
        ),
    }


def risk_and_coverage(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Risk when only the most certain claims count; naming anything without a known cause is wrong."""
    named = [o for o in outcomes if o.primary is not None]
    curve = risk_coverage([_probability(o) for o in named], [o.family_right for o in named], len(outcomes))
    return {
        "curve": curve,
        "coverage": len(named) / len(outcomes) if outcomes else None,
        "risk": float(np.mean([not o.family_right for o in named])) if named else None,
        "mean_risk_over_coverage": float(np.mean([r for _, r in curve])) if curve else None,
    }


def calibration(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Stated probability of the named effect against its being right, family and place."""
    named = [o for o in outcomes if o.primary is not None]
    stated = [_probability(o) for o in named]
    right = [o.name_right for o in named]
    bins = []
    for low in np.arange(10) / 10:
        part = [
            r for p, r in zip(stated, right, strict=True) if low <= p < low + 0.1 or (low > 0.85 and p == 1)
        ]
        if part:
            bins.append({"from": float(low), "to": float(low + 0.1), "right": Share.of(part).as_dict()})
    return {
        "n": len(named),
        "ece": expected_calibration_error(stated, right),
        "brier": brier_score(stated, right),
        "bins": bins,
    }


def _probability(o: Outcome) -> float:
    return float(o.primary.get("probability") or 0.0) if o.primary is not None else 0.0
