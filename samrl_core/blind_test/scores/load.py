"""From a study's folders and opened labels to outcomes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.blind_test.scores.outcome import TILE_CHANGE, Outcome, SealedTruth, Shrinks
from samrl_core.blind_test.scores.shrink_scores import shrinks_of
from samrl_core.blind_test.scores.study import Sealed, Study
from samrl_core.common.errors import InputError


def load_outcomes(
    study: Study,
    sealed: Sealed,
    stage: str,
    worlds: list[str],
    withheld: bool = False,
    unfinished: bool = False,
) -> list[Outcome]:
    """One outcome per world of the list, whatever became of it.

    Raises:
        InputError: worlds that were not run yet (with `unfinished` they count as crashed), or a world of
            the list without a sealed label.
    """
    labels = sealed.labels()
    if unknown := [w for w in worlds if w not in labels]:
        raise InputError(f"{len(unknown)} worlds have no sealed label, the first is {unknown[0]}")
    missing = [w for w in worlds if not (study.run_folder(stage, w) / "run.json").exists()]
    if missing and not unfinished:
        raise InputError(
            f"{len(missing)} of {len(worlds)} worlds have no result in {study.root / stage}; run samrl forge"
            " diagnose again (it resumes), or score with --unfinished, which counts them as wrong"
        )
    return [
        _outcome(
            study.run_folder(stage, world),
            SealedTruth.from_label(labels[world]),
            sealed.oracle(world),
            withheld,
        )
        for world in worlds
    ]


def read_report(folder: Path) -> dict[str, Any] | None:
    """The report of a run that ended well; None if it crashed, was refused, or wrote something unreadable."""
    run, report = folder / "run.json", folder / "report.json"
    if not run.exists() or not report.exists() or json.loads(run.read_text())["exit_code"] != 0:
        return None
    try:
        content = json.loads(report.read_text())
    except ValueError:
        return None
    return content if isinstance(content, dict) and "verdict" in content else None


def _outcome(
    folder: Path, truth: SealedTruth, oracle: dict[str, np.ndarray] | None, withheld: bool
) -> Outcome:
    run = json.loads((folder / "run.json").read_text()) if (folder / "run.json").exists() else {}
    report, shrinks, detail = read_report(folder), None, {"output": run.get("output", "")}
    for key in ("oracle_shrink", "oracle_nominal", "oracle_effect"):
        if oracle is not None and key in oracle:
            detail[key] = float(oracle[key])
    if report is not None and oracle is not None and (folder / "resimulation.npz").exists():
        shrinks, problem = _shrinks(folder / "resimulation.npz", oracle)
        detail["resimulation"] = problem
    tiles = {
        key.removeprefix(TILE_CHANGE): size
        for key, size in (oracle or {}).items()
        if key.startswith(TILE_CHANGE)
    }
    return Outcome(truth, report, run.get("seconds"), shrinks, withheld, detail, tiles)


def _shrinks(path: Path, oracle: dict[str, np.ndarray]) -> tuple[Shrinks | None, str]:
    """A re-simulation that cannot be evaluated shrinks nothing; the reason is recorded."""
    try:
        return shrinks_of(path, oracle), ""
    except (InputError, ValueError, OSError) as error:
        return None, str(error)
