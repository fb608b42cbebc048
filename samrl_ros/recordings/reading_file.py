"""Recordings of readings in files: arrays with one JSON text, written whole."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from samrl_core.cell.types.reading_recording import ReadingRecording, ReadingTolerances
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.kinds.readings.readings import split_readings
from samrl_core.diagnosis.recordings.held_out import shared_runs
from samrl_ros.recordings.arrays_by_role import (
    check_unseen,
    read_by_role,
    read_described,
    write_described,
)

SUFFIX = ".readings.npz"
VERSION = 1
_ARRAYS = ("time", "reading", "reference")
_TEXTS = ("name", "source", "sha256", "quantity", "sensor")
_SAME = 0.05  # share of held-out readings found in the fitted ones from which on they are the same
_RUN, _DISTINCT = 16, 4  # readings of a run that is compared, and different ones that it needs


def is_reading_file(path: Path) -> bool:
    """Whether a path is named like a recording of readings."""
    return path.name.endswith(SUFFIX)


def write_reading_file(recording: ReadingRecording, path: Path) -> None:
    """Write a recording; an existing file is replaced."""
    about = {"version": VERSION, "tolerances": asdict(recording.tolerances)}
    about |= {key: getattr(recording, key) for key in _TEXTS}
    arrays = {key: np.asarray(getattr(recording, key)) for key in _ARRAYS}
    write_described(path, about, arrays)


def read_reading_file(path: Path) -> ReadingRecording:
    """Read a recording.

    Raises:
        InputError: the file is damaged, of another version or none of readings.
    """
    try:
        arrays, about = read_described(path, VERSION)
        name, source, sha256, quantity, sensor = (str(about[key]) for key in _TEXTS)
        time, reading, reference = (arrays[key] for key in _ARRAYS)
        tolerances = ReadingTolerances.from_mapping(about["tolerances"])
        return ReadingRecording(name, source, sha256, quantity, sensor, time, reading, reference, tolerances)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"{path} is no recording of readings: {error}; import it again") from error


def load_reading_files(
    fit_paths: Sequence[Path], held_paths: Sequence[Path], tolerances: Path | None
) -> tuple[list[ReadingRecording], list[ReadingRecording], list[str]]:
    """Recordings by role, held-out data unseen, with notes; tolerances of a YAML file replace their own.

    Raises:
        InputError: as `read_reading_file`; files of another kind; held-out readings that were fitted.
    """
    stated = (ReadingTolerances, tolerances)
    return reading_roles(*read_by_role(fit_paths, held_paths, SUFFIX, read_reading_file, stated))


def shared_readings(known: ReadingRecording, unseen: ReadingRecording) -> float:
    """Share of the readings of `unseen`, with their references, that are also in `known`.

    Rounded readings repeat by chance, as depth in whole millimetres at one distance does. Where those of
    `known` repeat within it, runs of `unseen` count that occur there in the same order, or all of it.
    """
    seen, other = (np.stack([r.reading, r.reference], axis=1) for r in (known, unseen))
    cells = seen.view("f8,f8")[:, 0]
    _, place, count = np.unique(cells, return_inverse=True, return_counts=True)
    if float(np.mean(count[place] > 1)) <= _SAME:
        return float(np.isin(other.view("f8,f8")[:, 0], cells).mean())
    if np.array_equal(seen, other):
        return 1.0
    return shared_runs(seen, other, _RUN, _DISTINCT)


def reading_roles(
    fit: list[ReadingRecording], held: list[ReadingRecording]
) -> tuple[list[ReadingRecording], list[ReadingRecording], list[str]]:
    """Recordings by role, a part held out where none is, with notes.

    Raises:
        InputError: held-out readings that were fitted, or too few to hold any out.
    """
    if not held:
        first, last = split_readings(fit[0])
        return [first], [last], [f"{fit[0].name} is alone: a part of it is held out"]
    for unseen in held:
        for known in fit:
            share = shared_readings(known, unseen)
            check_unseen(share, _SAME, unseen.name, f"the fitted {known.name}", "readings")
    return fit, held, []
