"""Scores of how far the gap shrank on the held-out recording, beside what the true effect reaches."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.blind_test.scores.outcome import Outcome, Shrinks
from samrl_core.common.errors import InputError
from samrl_core.common.statistics import summarise_values
from samrl_core.diagnosis.selection.gap_metric import QUANTITIES, gap_metric, shrink

VISIBLE = 0.1  # oracle shrink from which on a ratio to it is stable


def shrinks_of(resimulation: Path, oracle: Mapping[str, np.ndarray]) -> Shrinks:
    """From the diagnosis' resimulation.npz and the sealed oracle, both against the same measurement.

    The oracle holds `time` (N,), `effect_<quantity>` (N, J) and `scale_<quantity>` (J,); it is interpolated
    to the stamps of the re-simulation. Without a named effect, `with_effect` is the nominal model again.

    Raises:
        InputError: the file lacks `time` or every channel.
    """
    with np.load(resimulation) as file:
        data = {name: np.asarray(file[name], float) for name in file.files}
    if "time" not in data:
        raise InputError(f"{resimulation} has no `time`")
    scales = {q: oracle[f"scale_{q}"] for q in QUANTITIES if f"scale_{q}" in oracle}

    def part(kind: str) -> dict[str, np.ndarray]:
        keyed = {q: data.get(f"{q}_{kind}") for q in QUANTITIES}
        return {q: v for q, v in keyed.items() if v is not None and v.ndim == 2}

    true = {
        q: _interpolated(data["time"], oracle["time"], oracle[f"effect_{q}"])
        for q in QUANTITIES
        if f"effect_{q}" in oracle
    }
    measured, nominal, named = part("measured"), part("nominal"), part("with_effect")
    before = gap_metric(measured, nominal, scales)
    after = gap_metric(measured, named, scales) if named else before
    if true:  # the same channels for all three, so that the ratio compares like with like
        common = {q: v for q, v in measured.items() if q in true and q in nominal}
        base = gap_metric(common, nominal, scales)
        best = gap_metric(common, true, scales)
        mine = shrink(base, gap_metric(common, named, scales)) if named else 0.0
        return Shrinks(base, base * (1 - mine), best, mine, shrink(base, best))
    return Shrinks(before, after, None, shrink(before, after), None)


def shrink_scores(single: list[Outcome], rng: np.random.Generator) -> dict[str, Any]:
    """Shrink S, S* = S over the oracle's, and the margin to the runner-up; unnamed worlds count as S = 0."""

    def of(part: list[Outcome]) -> dict[str, Any]:
        measured = [_shrink(o) for o in part]
        ratios = [_shrink(o) / s for o in part if (s := _oracle(o)) is not None and s >= VISIBLE]
        known = [o for o in part if _oracle(o) is not None]
        total = sum(max(_oracle(o) or 0.0, 0.0) for o in known)
        return {
            "worlds": len(part),
            "shrink": summarise_values(measured, rng),
            "oracle_shrink": summarise_values([s for o in part if (s := _oracle(o)) is not None], rng),
            "ratio": summarise_values(ratios, rng),
            "energy_ratio_pooled": _pooled_energy(part),
            "ratio_pooled": sum(_shrink(o) for o in known) / total if total > 0 else None,
            "oracle_missing": len(part) - len(known),
            "effect_invisible_on_held_out": len(known) - len(ratios),
        }

    named = [o for o in single if o.primary is not None]
    margins = [m for o in named if (m := _margin(o)) is not None]
    stated = [s for o in named if (s := _stated(o, "shrink")) is not None]
    return {
        "all": of(single),
        "named": of(named),
        "named_right": of([o for o in named if o.name_right]),
        "named_wrong": of([o for o in named if not o.family_right]),
        "stated_shrink": summarise_values(stated, rng),
        "margin_to_runner_up": summarise_values(margins, rng),
    }


def _interpolated(time: np.ndarray, known: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.stack([np.interp(time, known, column) for column in np.asarray(values, float).T], axis=1)


def _shrink(o: Outcome) -> float:
    return o.shrinks.shrink if o.shrinks is not None and o.primary is not None else 0.0


def _oracle(o: Outcome) -> float | None:
    """The oracle's shrink, stored beside the outcome where the diagnosis left no re-simulation."""
    if o.shrinks is not None:
        return o.shrinks.oracle_shrink
    stored = o.detail.get("oracle_shrink")
    return None if stored is None else float(stored)


def _pooled_energy(part: list[Outcome]) -> float | None:
    """Squared gap removed by the named effects over what the true ones remove, summed over the worlds.

    Background within tolerance stays in both gaps and drops out here; in a ratio of RMS values it does not.
    """
    removed, possible = 0.0, 0.0
    for o in part:
        s = o.shrinks
        before = s.nominal if s is not None else o.detail.get("oracle_nominal")
        best = s.oracle if s is not None else o.detail.get("oracle_effect")
        if before is None or best is None:
            continue
        possible += max(before**2 - best**2, 0.0)
        if s is not None and o.primary is not None:
            removed += before**2 - min(s.with_effect, 2 * before) ** 2
    return removed / possible if possible > 0 else None


def _stated(o: Outcome, key: str) -> float | None:
    held_out = ((o.report or {}).get("gap") or {}).get("held_out") or {}
    return None if held_out.get(key) is None else float(held_out[key])


def _margin(o: Outcome) -> float | None:
    margin, s = _stated(o, "margin"), _stated(o, "shrink")
    if margin is not None or s is None:
        return margin
    before, runner = _stated(o, "nominal"), _stated(o, "runner_up")
    return None if before is None or runner is None or before <= 0 else s - (1 - runner / before)
