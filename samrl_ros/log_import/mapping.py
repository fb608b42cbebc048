"""Reads and checks a mapping file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from samrl_core.common.errors import InputError
from samrl_core.common.text_files import read_text
from samrl_ros.log_import.imported_files import entries_of
from samrl_ros.log_import.specs import RecordingSpec


@dataclass(frozen=True)
class Mapping:
    """A mapping file."""

    path: Path
    recordings: tuple[RecordingSpec, ...]
    text: str  # as the file holds it


def read_mapping(path: Path | str) -> Mapping:
    """Read and check a mapping. Raises `InputError` with the exact key path of what is wrong."""
    path = Path(path)
    return parse_mapping(read_text(path, "the mapping"), path)


def parse_mapping(text: str, path: Path) -> Mapping:
    """The mapping that a file of this path holds, or would hold. Raises `InputError` as `read_mapping`."""
    general, entries = entries_of(text, path)
    recordings = []
    for number, entry in enumerate(entries):
        where = f"{path.name}: recordings[{number}]"
        own = {**general, **entry} if isinstance(entry, dict) else entry
        recordings.append(RecordingSpec.read(own, where))
    names = [recording.name for recording in recordings]
    if not names or len(set(names)) != len(names):
        raise InputError(f"{path.name}: recordings {names}: at least one, and each name once")
    return Mapping(path, tuple(recordings), text)
