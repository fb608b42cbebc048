"""Runs a mapping of readings: columns of a sensor and of its reference to recordings."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import model_validator

from samrl_core.cell.types.reading_recording import UNITS, ReadingRecording, ReadingTolerances
from samrl_core.common.errors import InputError
from samrl_core.common.validation import Checked, fault
from samrl_ros.log_import.formulas import evaluate
from samrl_ros.log_import.imported_files import check_names, entries_of
from samrl_ros.log_import.pose_specs import LENGTHS, Formula, FormulaList
from samrl_ros.log_import.sources import SourceData, read_source, update_digest
from samrl_ros.log_import.specs import LoggedSpec
from samrl_ros.log_import.units import UNITS as UNITS_OF_LOGS

FACTORS = {"depth": LENGTHS, "stamp": UNITS_OF_LOGS["time"]}


class ReadingsSpec(Checked):
    """One quantity as the sensor gave it and as it was, sample by sample of one source."""

    quantity: Literal["depth", "stamp"]
    sensor: str = "camera"
    source: str | None = None
    reading: Formula
    reference: Formula
    unit: str | None = None  # of both; None: m or s

    @property
    def quantities(self) -> dict[str, FormulaList]:
        """Formulas by key, as `read_source` looks for them."""
        return {"reading": FormulaList([self.reading]), "reference": FormulaList([self.reference])}

    @model_validator(mode="after")
    def _unit_fits(self) -> ReadingsSpec:
        known = FACTORS[self.quantity]
        if self.unit is not None and self.unit not in known:
            raise fault(f" is {self.unit!r}; {self.quantity} is in one of {', '.join(known)}", "unit")
        return self


class ReadingRecordingSpec(LoggedSpec):
    """Everything about one recording of readings, general keys and its own merged."""

    role: Literal["fit", "held_out"] = "fit"
    readings: ReadingsSpec

    def readers(self) -> dict[str, ReadingsSpec]:
        """Its two columns."""
        return {"readings": self.readings}


@dataclass(frozen=True, eq=False)
class ImportedReadings:
    """A recording of readings made from a log, and what became of it."""

    recording: ReadingRecording
    role: str  # fit or held_out
    report: tuple[str, ...]
    notes: tuple[str, ...]


def readings_of(text: str, path: Path, data: Path) -> list[ImportedReadings]:
    """Every recording of a mapping's text; `path` names it in messages.

    Raises:
        InputError: with the key path of what is wrong.
    """
    general, entries = entries_of(text, path)
    made = []
    for number, entry in enumerate(entries):
        own = {**general, **entry} if isinstance(entry, dict) else entry
        spec = ReadingRecordingSpec.read(own, f"{path.name}: recordings[{number}]")
        made.append(import_readings(spec, text, data))
    check_names(made, path)
    return made


def import_readings(spec: ReadingRecordingSpec, text: str, data: Path) -> ImportedReadings:
    """Make one recording; `text` is the mapping's.

    Raises:
        InputError: with the key path of what is wrong.
    """
    notes: list[str] = []
    constants = {name: np.asarray(value, dtype=float) for name, value in spec.constants.items()}
    untimed = spec.readings.quantity == "depth"
    source: SourceData = read_source(spec, spec.source_of(spec.readings), constants, data, notes, untimed)
    given, where, count = spec.readings, f"{spec.path}.readings", len(source.time)
    factor = FACTORS[given.quantity][given.unit or UNITS[given.quantity]]

    def values(key: str) -> np.ndarray:
        made = np.asarray(evaluate(getattr(given, key), source.values, f"{where}.{key}"), dtype=float)
        if made.shape not in ((), (count,)):
            raise InputError(
                f"{where}.{key} gives shape {made.shape}, must be one number per sample, ({count},)"
            )
        return factor * np.broadcast_to(made, (count,))

    tolerances = ReadingTolerances()
    if spec.tolerances is not None:
        try:
            tolerances = ReadingTolerances.from_mapping(spec.tolerances)
        except InputError as error:
            raise InputError(f"{spec.path}.tolerances: {error}") from error
    digest = hashlib.sha256(text.encode() + spec.name.encode())
    for file in source.files:
        update_digest(digest, file)
    recording = ReadingRecording(
        spec.name, ", ".join(map(str, source.files)), digest.hexdigest(), given.quantity, given.sensor,
        source.time - source.time[0], values("reading"), values("reference"), tolerances,
    )  # fmt: skip
    error = recording.reading - recording.reference
    unit = UNITS[given.quantity]
    report = (
        f"{given.quantity} of {given.sensor}: {count} readings, {recording.duration:.3f} s",
        f"reading minus reference: median {np.median(error):.4g} {unit},"
        f" {error.min():.4g} .. {error.max():.4g} {unit}",
    )
    return ImportedReadings(recording, spec.role, report, tuple(notes))
