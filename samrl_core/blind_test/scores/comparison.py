"""The diagnosis beside the baselines, on the worlds that they were asked about."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from samrl_core.blind_test.scores.load import load_outcomes
from samrl_core.blind_test.scores.outcome import Outcome
from samrl_core.blind_test.scores.scores import MEDIAN_SEVERITY, share
from samrl_core.blind_test.scores.study import Sealed, Study

NAMES = ("argmin_rmse", "all_parameters", "sparse_regression", "mujoco_sysid")  # folders below baselines/


def comparison(study: Study, sealed: Sealed, outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    """One row per baseline that was run; the diagnosis on the same worlds stands before them."""
    rows: list[dict[str, Any]] = []
    shown: tuple[str, ...] = ()
    for name in NAMES:
        folder = study.root / "baselines" / name
        asked = tuple(o.truth.id for o in outcomes if (folder / o.truth.id / "run.json").exists())
        if not asked:
            continue
        if asked != shown:
            same = [o for o in outcomes if o.truth.id in set(asked)]
            rows.append(comparison_row(f"diagnosis, {len(asked)} worlds", same))
            shown = asked
        rows.append(comparison_row(name, load_outcomes(study, sealed, f"baselines/{name}", list(asked))))
    return rows


def comparison_row(name: str, outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """The scores that a bare name can have."""
    single = [o for o in outcomes if o.truth.set == "single"]
    severe = [o for o in single if o.truth.severity >= MEDIAN_SEVERITY]
    none = [o for o in outcomes if o.truth.set == "none"]
    outside = [o for o in outcomes if o.truth.set == "outside"]
    return {
        "name": name,
        "worlds": len(outcomes),
        "top1_family": share(single, lambda o: o.family_right),
        "top1_family_severe": share(severe, lambda o: o.family_right),
        "top1_family_place": share(single, lambda o: o.name_right),
        "false_alarms": share(none, lambda o: o.alarmed),
        "unknown_named": share(outside, lambda o: o.primary is not None),
        "seconds": [o.seconds for o in outcomes],
    }
