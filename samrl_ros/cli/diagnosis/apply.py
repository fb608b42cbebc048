"""`--apply`: the corrected description beside a report.

Of poses it is a calibration, as `samrl cell --hardware --hand-eye` reads it; of an arm its URDF, as
`samrl diagnose --urdf` reads it.
"""

from __future__ import annotations

from pathlib import Path

from samrl_core.diagnosis.export.applied_model import write_applied_model
from samrl_core.diagnosis.export.correction import Correction
from samrl_core.diagnosis.export.recalibration import Recalibration, write_recalibration
from samrl_core.diagnosis.result import Diagnosis

APPLY = "apply"  # folder below the report


def apply(found: Correction | Recalibration | None, diagnosis: Diagnosis, report: Path) -> list[str]:
    """Write the corrected calibration or arm of a diagnosis; lines that say what became of it.

    Raises:
        InputError: an arm without a URDF.
    """
    if isinstance(found, Correction) and diagnosis.verdict == "effect":
        return _apply_to_arm(found, report / APPLY)
    if not isinstance(found, Recalibration):
        why = {
            "ambiguous": "several causes fit alike; record what would split them first",
            "no_gap": "nothing differs from the description",
        }.get(diagnosis.verdict, "nothing was named")
        return [f"nothing was applied: {why}"]
    written = write_recalibration(found, report / APPLY)
    lines = [f"applied: {t.name}, from {t.effect}" for t in found.transforms]
    by_name = ", ".join(f"{name} {value:.5g}" for name, value in found.numbers.items())
    lines += [f"applied: {by_name}, from {', '.join(found.of_numbers)}"] if found.numbers else []
    zeros = (one for of_arm in found.zeros.values() for one in of_arm.items())
    lines += [
        f"applied: {joint} reads {zero:.5f} rad too much, from {effect}"
        for (joint, zero), effect in zip(zeros, found.of_zeros, strict=True)
    ]
    lines += [f"not applied: {r.effect}: {r.says}" for r in found.refused]
    lines += [f"for your own code: {s.effect}: {s.says}" for s in found.statements]
    return [*lines, *(str(path) for path in written)]


def _apply_to_arm(found: Correction, folder: Path) -> list[str]:
    done = write_applied_model(found, folder)
    lines = [f"applied: {s.place}: {s.said}" for s in done.inside]
    lines += [f"for your own code: {s.place}: {s.what}: {s.said}" for s in done.outside]
    lines += [f"for your own code: {name}: no number of a model stands for it" for name in done.unsimulated]
    return [*lines, *(str(path) for path in done.files)]
