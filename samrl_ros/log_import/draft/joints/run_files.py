"""Which files of a log are recordings of one machine: alike in a folder, or of one name in a folder each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from samrl_core.common.errors import InputError
from samrl_core.common.files import is_folder
from samrl_ros.log_import.draft.blocks import LogPart
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.formats.hdf5 import SUFFIXES as HDF5
from samrl_ros.log_import.formats.hdf5 import demonstrations
from samrl_ros.log_import.formats.parquet import episodes, is_lerobot
from samrl_ros.log_import.formats.rosbag import is_bag
from samrl_ros.log_import.tables import RARELY_LOGS, SUFFIXES, is_text_table, remedy_of

_SHOWN = 8  # files that a message names
_MOST_EPISODES = 20  # of a dataset, that become recordings


@dataclass(frozen=True)
class RunFile:
    """A recording's file, and how a mapping names it."""

    path: Path
    name: str  # of the recording
    pattern: str  # of all such files, with {name}


def files_in(path: Path) -> list[Path]:
    """A log's files: itself, or what lies in a folder, or else one of the same name in each folder there.

    Raises:
        InputError: a folder without any.
    """
    if is_bag(path) or is_lerobot(path) or not is_folder(path):
        return [path]
    if inside := _logs_in(path):
        return inside
    below = [_of_a_run(folder) for folder in sorted(path.iterdir()) if is_folder(folder)]
    each = [files[0] for files in below if len(files) == 1]
    if len(each) > 1 and len({file.name for file in each}) == 1:
        return each
    inside = sorted(path.iterdir())
    there = f"; there is {', '.join(file.name for file in inside[:_SHOWN])}" if inside else "; it is empty"
    raise InputError(
        f"{path} holds no log: no bag, no LeRobot dataset, no {', '.join(SUFFIXES)}{there}{remedy_of(inside)}"
    )


def _of_a_run(folder: Path) -> list[Path]:
    """A run's logs: in its folder or in the only one there; what describes them in JSON is none."""
    files, inside = _logs_in(folder), [path for path in folder.iterdir() if is_folder(path)]
    if not files and len(inside) == 1:
        files = _logs_in(inside[0])
    return [file for file in files if file.suffix.lower() != ".json"] or files


def _logs_in(folder: Path) -> list[Path]:
    """By name; text under any other suffix, settings and weights where there is nothing else."""
    files = sorted(folder.iterdir())
    known = [file for file in files if file.suffix.lower() in SUFFIXES]
    usual = [file for file in known if file.suffix.lower() not in RARELY_LOGS]
    return usual or [file for file in files if is_text_table(file)] or known


def runs_alike(parts: Sequence[LogPart]) -> list[RunFile]:
    """Files that hold the same columns, if that is all there is; else none.

    They are of one kind and folder, or have one name in folders beside each other, after which they are
    called then.
    """
    paths = list(dict.fromkeys(part.path for part in parts))
    alike = {
        (part.path.suffix, part.part, frozenset(part.times), *((b.stem, b.columns) for b in part.blocks))
        for part in parts
    }
    if len(paths) < 2 or len(paths) != len(parts) or len(alike) > 1 or parts[0].ros:
        return []
    if len({path.parent for path in paths}) == 1:
        return [RunFile(path, path.stem, f"{{name}}{path.suffix}") for path in paths]
    if len({len(path.parts) for path in paths}) > 1:
        return []
    apart = [
        k for k, names in enumerate(zip(*(path.parts for path in paths), strict=True)) if len(set(names)) > 1
    ]
    if len(apart) != 1 or len({path.parts[apart[0]] for path in paths}) < len(paths):
        return []
    below = "/".join(paths[0].parts[apart[0] + 1 :])
    return [RunFile(path, path.parts[apart[0]], f"{{name}}/{below}") for path in paths]


def recordings_of(runs: Sequence[RunFile], draft: Draft) -> list[dict[str, Any]]:
    """One for each file; the last is held out."""
    named = "folder" if "/" in runs[0].pattern else "name"
    draft.note("recordings", f"files with the same columns: one machine's; the last by {named} is held out")
    return [{"name": run.name, "role": "held_out" if run is runs[-1] else "fit"} for run in runs]


def recordings_in(files: list[Path], draft: Draft) -> list[dict[str, Any]]:
    """One; of a dataset one per episode or demonstration, of which the last is held out."""
    there = _episodes(files[0]) if len(files) == 1 else {}
    if there:
        most = dict(list(there.items())[:_MOST_EPISODES])
        last = list(most)[-1] if len(most) > 1 else ""
        beyond = f"the first {len(most)} of {len(there)}" if len(there) > len(most) else f"{len(most)}"
        draft.note("recordings", f"{beyond} episodes" + (f"; the last, {last}, is held out" if last else ""))
        return [
            {"name": name, "role": "held_out" if name == last else "fit", "parts": {"states": part}}
            for name, part in most.items()
        ]
    name = files[0].stem if len(files) == 1 else files[0].parent.name
    return [{"name": name or "log", "role": "fit"}]


def _episodes(file: Path) -> dict[str, str]:
    """Parts of a dataset by name: a LeRobot dataset's episodes, robomimic's demonstrations; else none."""
    if is_lerobot(file):
        return {f"episode_{number}": number for number in episodes(file)}
    if file.suffix.lower() in HDF5:
        return {part.rpartition("/")[2]: part for part in demonstrations(file)}
    return {}
