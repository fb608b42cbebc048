"""`samrl diagnose --export`: what was named, written into the models of other simulators."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from samrl_core.common.errors import InputError
from samrl_core.common.files import is_file
from samrl_core.common.names import known_are
from samrl_core.diagnosis.export.correction import Correction, read_correction, write_correction
from samrl_core.diagnosis.export.export import TARGETS, Export, write_export
from samrl_core.diagnosis.export.statement import CONTROLLER, MISSING, NEAREST
from samrl_core.diagnosis.nominal_model.nominal_model import NominalModel

FOLDER = "export"


def check_targets(targets: Sequence[str]) -> None:
    """Raises `InputError` for a simulator that is not known."""
    for target in targets:
        if target not in TARGETS:
            raise InputError(f"unknown simulator {target!r} in --export; {known_are(target, TARGETS)}")


def is_report(paths: Sequence[Path]) -> bool:
    """Whether the arguments are one folder of a report, not recordings."""
    return len(paths) == 1 and is_file(paths[0] / "report.json")


def keep_correction(correction: Correction, model: NominalModel | None, report: Path) -> Correction:
    """Put a correction into its report's folder, with the user's own model."""
    if model is not None:
        path = "" if model.path is None else str(model.path.resolve())
        correction = replace(correction, model={"form": model.form, "path": path, "source": model.source})
    write_correction(correction, report)
    return correction


def export_report(
    report: Path, model: NominalModel | None, targets: Sequence[str], randomise: bool, screen: Console
) -> None:
    """Export what a report has named.

    Raises:
        InputError: the report named nothing, or as `write_export`.
    """
    if not targets:
        raise InputError(f"{report} is a report: say what to do with it, --export {'|'.join(TARGETS)}")
    correction = read_correction(report)
    if model is not None:
        correction = keep_correction(correction, model, report)
    export_all(correction, targets, report, randomise, screen)


def export_all(
    correction: Correction, targets: Sequence[str], report: Path, randomise: bool, screen: Console
) -> None:
    """Write each target's folder below the report and say in a few lines what became of it."""
    for target in dict.fromkeys(targets):
        with screen.status(f"exporting to {target}"):
            done = write_export(correction, target, report / FOLDER / target, randomise)
        for line in _summary(done, correction):
            screen.print(escape(line), highlight=False, soft_wrap=True)


def _summary(done: Export, correction: Correction) -> list[str]:
    lines = [f"{done.target}: {done.folder / 'export.html'}"]
    for how, words in ((NEAREST, "nearest"), (CONTROLLER, "in your code"), (MISSING, "not there")):
        for s in (s for s in done.statements if s.how == how):
            left = "" if s.error is None else f" ({s.error:.0%} of it left)"
            lines.append(f"  {words}: {s.place} {s.what}: {s.said}{left}")
    if done.resimulated is None:
        lines.append(f"  not re-simulated: {done.why_not}")
    else:
        promise = correction.promise.get("shrink")
        told = "" if promise is None else f" (the report: {promise:.0%})"
        lines.append(
            f"  re-simulated there, the held-out gap shrinks by {done.resimulated['shrink']:.0%}{told}"
        )
    return lines
