"""Scores of images: which tiles show the gap, and how near sizes come to what noise allows."""

from __future__ import annotations

from typing import Any

import numpy as np

from samrl_core.blind_test.scores.effect_scores import comparable
from samrl_core.blind_test.scores.outcome import Outcome
from samrl_core.common.statistics import Share

# Change of a tile from which on it counts as changed, by channel: about twice what noise of a tile leaves
# in the mean of 24 images (2.2 mm, 0.5 px, 0.065 and 0.4 in one; medians of typical cells).
VISIBLE = {"depth": 0.001, "mask": 0.25, "color": 0.03, "depth_noise": 0.2}  # [m], [px], [1], [log]
HALF = 0.5  # aim of an IoU


def tile_scores(single: list[Outcome]) -> dict[str, Any]:
    """IoU of the tiles in worlds with a known cause; 0 where no gap was detected."""
    there = [o for o in single if o.tiles]
    found = {o.truth.id: tile_iou(o) for o in there}
    known = [v for v in found.values() if v is not None]
    return {
        "worlds": found,
        "median": float(np.median(known)) if known else None,
        "half": Share.of([v >= HALF for v in known]).as_dict(),
        "half_of_detected": Share.of(
            [v >= HALF for o in there if o.detected and (v := found[o.truth.id]) is not None]
        ).as_dict(),
    }


def tile_iou(o: Outcome) -> float | None:
    """Intersection over union of changed and reported tiles, over all channels' tiles that were compared.

    A diagnosis reports none unless it detects a gap. None where its cause changes no such tile visibly.
    """
    listed = (o.report or {}).get("tiles") or ()
    said = {(t["channel"], tile) for t in listed for tile in t["stand_out"]} if o.detected else set()
    compared = {(t["channel"], tile) for t in listed for tile in t["compared"]}
    true = {
        (channel, int(tile))
        for channel, least in VISIBLE.items()
        for tile in np.flatnonzero(np.nan_to_num(np.asarray(o.tiles.get(channel, ()))) > least)
    }
    true &= compared
    return len(true & said) / len(true | said) if true else (0.0 if not listed else None)


def bound_scores(single: list[Outcome]) -> dict[str, Any]:
    """Errors of rightly named parameters and their stated deviations, in least deviations that noise allows.

    A factor of 1 is an estimate that nothing but the tiles' noise disturbs. `error` is the root mean square
    over the parameters of a world; `stated` the median of their 95 % intervals over 3.92 of that deviation.
    """
    errors: dict[str, float] = {}
    stated: dict[str, float] = {}
    for o in single:
        if not o.name_right or o.primary is None or o.report is None:
            continue
        bound = (o.report.get("information") or {}).get(f"{o.primary['family']}@{o.primary['place']}", {})
        pairs = comparable(o.primary.get("parameters", {}), o.truth.effects[0]["parameters"])
        rows = [(estimate, true, bound[name]) for name, estimate, true in pairs if bound.get(name)]
        if rows:
            errors[o.truth.id] = float(np.sqrt(np.mean([((e["value"] - t) / b) ** 2 for e, t, b in rows])))
            stated[o.truth.id] = float(
                np.median([(e["ci95"][1] - e["ci95"][0]) / 3.92 / b for e, _, b in rows])
            )
    return {
        "error": errors,
        "stated": stated,
        "error_median": float(np.median(list(errors.values()))) if errors else None,
        "stated_median": float(np.median(list(stated.values()))) if stated else None,
    }
