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

OTHER_SURFACE = 0.25  # of the distance, by which no sensor is off
FACTORS = {"depth": LENGTHS, "stamp": UNITS_OF_LOGS["time"]}


class ReadingsSpec(Checked):
    """One quantity as the sensor gave it and as it was, sample by sample of one source."""

    quantity: Literal["depth", "stamp"]
    sensor: str = "camera"
    source: str | None = None
    reading: Formula  # one number per sample, or a list: trials of that sample's reference, one after another
    reference: Formula
    unit: str | None = None  # of both; None: m or s
    image: Formula | None = None  # that each reading is of, and its surface there: of those of one image
    surface: Formula | None = None  # the one that is nearest to the reference counts

    @property
    def quantities(self) -> dict[str, FormulaList]:
        """Formulas by key, as `read_source` looks for them."""
        given = {key: getattr(self, key) for key in ("reading", "reference", "image", "surface")}
        return {key: FormulaList([formula]) for key, formula in given.items() if formula is not None}

    @model_validator(mode="after")
    def _unit_fits(self) -> ReadingsSpec:
        if (self.image is None) != (self.surface is None):
            raise fault(" needs image and surface together: of one image the nearest surface counts")
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

    def numbers(key: str) -> np.ndarray:
        made = np.asarray(evaluate(getattr(given, key), source.values, f"{where}.{key}"), dtype=float)
        if key == "reading" and made.ndim == 2 and len(made) == count and given.surface is None:
            return made
        if made.shape not in ((), (count,)):
            raise InputError(
                f"{where}.{key} gives shape {made.shape}, must be one number per sample, ({count},)"
            )
        return np.broadcast_to(made, (count,))

    reading, reference = factor * numbers("reading"), factor * numbers("reference")
    time = source.time
    if reading.ndim == 2:
        time, reading, reference = _one_after_another(time, reading, reference)
    keep = np.ones(len(reading), dtype=bool)
    log = spec.sources[spec.source_of(spec.readings)]
    if any((each.missing or log.missing) == "drop_cell" for each in log.columns.values()):
        keep = np.isfinite(reading) & np.isfinite(reference)
        if not keep.any():
            raise InputError(f"{where}: no row has a reading beside its reference; is a column empty?")
    if given.surface is not None:
        keep &= nearest_surfaces(numbers("image"), numbers("surface"), reading, reference, where, notes)
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
        (time - time[0])[keep], reading[keep], reference[keep], tolerances,
    )  # fmt: skip
    error = recording.reading - recording.reference
    unit = UNITS[given.quantity]
    report = (
        f"{given.quantity} of {given.sensor}: {len(error)} readings, {recording.duration:.3f} s",
        f"reading minus reference: median {np.median(error):.4g} {unit},"
        f" {error.min():.4g} .. {error.max():.4g} {unit}",
    )
    return ImportedReadings(recording, spec.role, report, tuple(notes))


def _one_after_another(
    time: np.ndarray, reading: np.ndarray, reference: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Trials (N, K) of each row's reference (N,) as (N * K,), spread over the time until the next row."""
    count, trials = reading.shape
    step = float(np.median(np.diff(time))) if count > 1 else 1.0
    spread = time[:, None] + step * np.arange(trials) / trials
    return spread.ravel(), reading.ravel(), np.repeat(reference, trials)


def nearest_surfaces(
    image: np.ndarray, surface: np.ndarray, reading: np.ndarray, reference: np.ndarray, where: str,
    notes: list[str],
) -> np.ndarray:  # fmt: skip
    """Readings (N,) of the surface of each image that is nearest to the reference: a board before a wall.

    Args:
        image: of each reading (N,), as its surface.
        surface: from 0, that of most depth first.
        reading: [m], as the reference.
        reference: where the board's plane is.
        where: for messages.
        notes: what was left out is added.

    Raises:
        InputError: in most images no surface is near the reference.
    """
    off = np.abs(reading / reference - 1.0)
    keep, smaller, none = np.zeros(len(off), dtype=bool), 0, 0
    images = np.unique(image)
    for one in images:
        there = image == one
        apart = {k: float(np.median(off[there & (surface == k)])) for k in np.unique(surface[there])}
        nearest = min(apart, key=apart.__getitem__)
        if apart[nearest] > OTHER_SURFACE:
            none += 1
            continue
        smaller += nearest > 0
        keep |= there & (surface == nearest)
    if none > 0.5 * len(images):
        raise InputError(
            f"{where}: in {none} of {len(images)} images no surface is within {OTHER_SURFACE:.0%} of the"
            f" reference ({np.median(reading):.3g} m read, {np.median(reference):.3g} m stated, medians)."
            " Are the board's poses in the depth camera and in m, is `per_metre` right, and does the board"
            " fill a fifth of the image's width?"
        )
    if none:
        notes.append(f"{where}: {none} of {len(images)} images show no surface near the reference")
    if smaller:
        notes.append(
            f"{where}: in {smaller} of {len(images)} images a larger surface than the reference's, as a wall"
            " behind a board, is left out"
        )
    return keep
