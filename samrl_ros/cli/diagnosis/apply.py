"""`--apply`: the corrected calibration beside a report, as `samrl cell --hardware --hand-eye` reads it."""

from __future__ import annotations

from pathlib import Path

from samrl_core.diagnosis.export.correction import Correction
from samrl_core.diagnosis.export.recalibration import Recalibration, write_recalibration
from samrl_core.diagnosis.result import Diagnosis

APPLY = "apply"  # folder below the report


def apply(found: Correction | Recalibration | None, diagnosis: Diagnosis, report: Path) -> list[str]:
    """Write the corrected calibration of a diagnosis of poses; lines that say what became of it."""
    if not isinstance(found, Recalibration):
        why = {
            "ambiguous": "several causes fit alike; record what would split them first",
            "no_gap": "nothing differs from the description",
        }.get(diagnosis.verdict, "nothing was named")
        return [f"nothing was applied: {why}"]
    written = write_recalibration(found, report / APPLY)
    lines = [f"applied: {t.name}, from {t.effect}" for t in found.transforms]
    lines += [f"for your own code: {s.effect}: {s.says}" for s in found.statements]
    return [*lines, *(str(path) for path in written)]
