"""Which files of a log are recordings of one machine: alike in a folder, or of one name in a folder each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.common.files import is_folder
from samrl_ros.log_import.draft.blocks import LogPart
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.roles_of_files import are_topics, split_roles
from samrl_ros.log_import.formats.hdf5 import SUFFIXES as HDF5
from samrl_ros.log_import.formats.hdf5 import demonstrations
from samrl_ros.log_import.formats.parquet import episodes, is_lerobot
from samrl_ros.log_import.formats.rosbag import is_bag
from samrl_ros.log_import.tables import RARELY_LOGS, SUFFIXES, is_text_table, remedy_of

_SHOWN = 8  # files that a message names
_MOST_EPISODES = 20  # of a dataset, that become recordings


@dataclass(frozen=True)
class Run:
    """A recording's files, and how a mapping names them."""

    name: str  # of the recording
    patterns: dict[Path, str]  # of all such files, with {name}


def files_in(path: Path) -> list[Path]:
    """A log's files: itself, or what lies in a folder, or else those of the same names in each folder there.

    Of several in each folder some names say that they are measured, others that they are commanded.

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
    sets = [files for files in below if files]
    same = len(sets) > 1 and len({tuple(file.name for file in files) for files in sets}) == 1
    if same and all(split_roles(sets[0])):
        return [file for files in sets for file in files]
    inside = sorted(path.iterdir())
    there = f"; there is {', '.join(file.name for file in inside[:_SHOWN])}" if inside else "; it is empty"
    if sets:
        there += f". Name the folder of one recording, such as {sets[0][0].parent}"
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


def runs_alike(parts: Sequence[LogPart]) -> list[Run]:
    """Recordings of the same columns, if that is all there is; else none.

    They are files of one kind and folder, or have one name in folders beside each other, after which they are
    called then. Of files in a folder that are topics of one recording, each folder beside it holds the same.

    Raises:
        InputError: files in folders beside each other, of one name and other columns; or as `are_topics`.
    """
    paths = list(dict.fromkeys(part.path for part in parts))
    if len(paths) < 2 or len(paths) != len(parts):
        return []
    names = dict.fromkeys(path.name for path in paths)
    folders = dict.fromkeys(path.parent for path in paths)
    if len(folders) > 1 < len(names) and all(split_roles([Path(name) for name in names])):
        return _runs_of_topics(parts, list(folders), list(names))
    if len({_layout(part) for part in parts}) > 1 or parts[0].ros:
        return []
    if len(folders) == 1:
        if are_topics({part.path: _span(part) for part in parts}):
            return []
        return [Run(path.stem, {path: f"{{name}}{path.suffix}"}) for path in paths]
    if len({len(path.parts) for path in paths}) > 1:
        return []
    apart = [
        k for k, names in enumerate(zip(*(path.parts for path in paths), strict=True)) if len(set(names)) > 1
    ]
    if len(apart) != 1 or len({path.parts[apart[0]] for path in paths}) < len(paths):
        return []
    below = "/".join(paths[0].parts[apart[0] + 1 :])
    return [Run(path.parts[apart[0]], {path: f"{{name}}/{below}"}) for path in paths]


def _runs_of_topics(parts: Sequence[LogPart], folders: Sequence[Path], names: Sequence[str]) -> list[Run]:
    """A run of each folder beside others, with files of these names in it."""
    if len({folder.parent for folder in folders}) > 1:
        return []
    layouts = {part.path: _layout(part) for part in parts}
    for folder in folders[1:]:
        for name in names:
            if layouts.get(folder / name) != layouts.get(folders[0] / name):
                raise InputError(
                    f"{folder / name} and {folders[0] / name} do not hold the same columns, so {folder.name}"
                    f" and {folders[0].name} are no recordings of one machine: take one of them out"
                )
    return [Run(each.name, {each / name: f"{{name}}/{name}" for name in names}) for each in folders]


def _layout(part: LogPart) -> tuple[object, ...]:
    """What files of the same columns have in common."""
    blocks = ((block.stem, block.columns) for block in part.blocks)
    return (part.path.suffix, part.part, frozenset(part.times), *blocks)


def _span(part: LogPart) -> tuple[float, float]:
    """First and last time of a file by its first clock, in its unit; NaN where it has none."""
    table = part.table
    time = table.time
    if time is None and (part.times or part.dates):
        read = table.numbers if part.times else table.times
        time = read((part.times or part.dates)[0], "the log")
    return (np.nan, np.nan) if time is None else (float(np.nanmin(time)), float(np.nanmax(time)))


def recordings_of(runs: Sequence[Run], draft: Draft) -> list[dict[str, Any]]:
    """One for each run; the last is held out."""
    patterns = list(runs[0].patterns.values())
    named = "folder" if "/" in patterns[0] else "name"
    what = "folders with the same files" if len(patterns) > 1 else "files with the same columns"
    draft.note("recordings", f"{what}: one machine's; the last by {named} is held out")
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
