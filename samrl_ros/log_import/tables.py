"""Logs of other tools as tables, by suffix or by what lies in a folder."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from samrl_core.common.array_file import UNREADABLE
from samrl_core.common.errors import InputError
from samrl_core.common.files import is_file, is_folder
from samrl_ros.log_import.formats.arrays import read_mat_table, read_numpy_table
from samrl_ros.log_import.formats.echoed_topic import is_echo
from samrl_ros.log_import.formats.hdf5 import read_hdf5_table
from samrl_ros.log_import.formats.json_log import read_json_table
from samrl_ros.log_import.formats.name_value import find_pairs
from samrl_ros.log_import.formats.parquet import (
    is_lerobot,
    read_feather_table,
    read_lerobot_table,
    read_parquet_table,
)
from samrl_ros.log_import.formats.point_clouds import SUFFIXES as CLOUDS
from samrl_ros.log_import.formats.rosbag import is_bag, read_topic_table
from samrl_ros.log_import.formats.teleplot import is_teleplot
from samrl_ros.log_import.formats.text import read_text_table
from samrl_ros.log_import.formats.torch_file import read_torch_table
from samrl_ros.log_import.formats.transform_tree import frames_of, read_transform_table
from samrl_ros.log_import.formats.views import is_of_views, read_views
from samrl_ros.log_import.formats.yaml_log import read_yaml_table
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.table import Table

TEXT_SUFFIXES = (".csv", ".tsv", ".txt", ".lvm")
YAML_SUFFIXES = (".yaml", ".yml", ".samples")  # the last of easy_handeye2
_NUMBERS = re.compile(r"(?<![\w.])[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?(?![\w.])")
_WORDS = re.compile(r"[A-Za-z]{3,}(?<!nan)(?<!NaN)(?<!inf)(?<!Inf)")
# What readers raise at files that they cannot read; scipy and pandas call some kinds "not implemented".
_UNREADABLE = (*UNREADABLE, pd.errors.ParserWarning, pd.errors.ParserError, NotImplementedError)


@dataclass(frozen=True)
class _Format:
    """How files of some suffixes are read, and whether they have parts."""

    suffixes: tuple[str, ...]
    read: Callable[[Path, str, CsvOptions, str], Table]
    parts: bool


FORMATS = (
    _Format(
        TEXT_SUFFIXES, lambda path, part, csv, where: read_text_table(path, part, csv, where), parts=True
    ),
    _Format((".npz", ".npy"), lambda path, part, csv, where: read_numpy_table(path), parts=False),
    _Format((".mat",), lambda path, part, csv, where: read_mat_table(path, where), parts=False),
    _Format((".parquet",), lambda path, part, csv, where: read_parquet_table(path, where), parts=False),
    _Format(
        (".feather", ".arrow"), lambda path, part, csv, where: read_feather_table(path, where), parts=False
    ),
    _Format(
        (".json", ".jsonl"), lambda path, part, csv, where: read_json_table(path, part, where), parts=True
    ),
    _Format(YAML_SUFFIXES, lambda path, part, csv, where: read_yaml_table(path, part, where), parts=True),
    _Format((".pt", ".pth"), lambda path, part, csv, where: read_torch_table(path, where), parts=False),
    _Format((".h5", ".hdf5"), lambda path, part, csv, where: read_hdf5_table(path, part, where), parts=True),
)
SUFFIXES = tuple(suffix for each in FORMATS for suffix in each.suffixes)
_CLOUD = "a cloud tells no motion; of a wall give the folder, in names how far it was (0.8m/cloud.ply)"
# Files that people have instead of a log, and what makes one of them.
_REMEDIES = dict.fromkeys(CLOUDS, _CLOUD) | {
    ".pkl": "a pickle may run code, so none is read; pandas.read_pickle(...).to_parquet('log.parquet')",
    ".pickle": "a pickle may run code, so none is read; pandas.read_pickle(...).to_parquet('log.parquet')",
    ".xlsx": "save the sheet as CSV, or pandas.read_excel(...).to_csv('log.csv', index=False)",
    ".xls": "save the sheet as CSV, or pandas.read_excel(...).to_csv('log.csv', index=False)",
    ".gz": "unpack it (gunzip)",
    ".zip": "unpack it (unzip)",
    ".zst": "unpack it (zstd -d)",
    ".tfrecord": "read it with tensorflow_datasets, and numpy.savez('log.npz', time=..., q=..., tau=...)",
    ".slx": "a Simulink model; log signals with To Workspace blocks and save(..., '-v7')",
    ".mldatx": "Simulink's archive; export its signals to timetables, and those to CSV",
}
# Beside other logs these are settings, notes and weights; they are logs where they are named, or alone.
RARELY_LOGS = (".yaml", ".yml", ".pt", ".pth")
_HEAD = 1 << 13  # bytes of a file of an unknown kind that are looked at
_OTHERS = (".urdf", ".xacro", ".xml", ".md", ".py", ".m", ".html", ".svg", *CLOUDS)  # that hold no table


def is_text_table(path: Path) -> bool:
    """Whether a file is a table in text: by its suffix, or by its first lines where that is unknown."""
    suffix = path.suffix.lower()
    if is_bag(path):
        return False
    if suffix in TEXT_SUFFIXES or suffix in SUFFIXES or suffix in _OTHERS:
        return suffix in TEXT_SUFFIXES
    if not is_file(path):
        return False
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD)
    except OSError:
        return False
    if b"\0" in head:
        return False
    lines = [line for line in head.decode("latin-1").splitlines()[:-1] if line.strip()]
    if find_pairs(lines) is not None or is_teleplot(lines):
        return True
    rows = [line for line in lines if len(_NUMBERS.findall(line)) > 1 and not _WORDS.search(line)]
    return len(rows) > 2 and 2 * len(rows) > len(lines)


def remedy_of(paths: Sequence[Path]) -> str:
    """What makes a log of files of known kinds that are not read, as the end of a message; else empty."""
    for path in paths:
        if remedy := _REMEDIES.get(path.suffix.lower()):
            return f"; {path.name}: {remedy}"
    return ""


def read_table(path: Path, options: CsvOptions, where: str, part: str = "") -> Table:
    """A log as a table.

    Args:
        path: a file, a bag's folder or a LeRobot dataset's; with a star for a file per view.
        options: how a text file is written.
        where: key path, for messages.
        part: topic of a bag or `CHILD in PARENT` of its frames, episode of a dataset, group of an HDF5 file,
            keys of a JSON or YAML file, what the rows of a labelled text file are of; else empty.

    Raises:
        InputError: nothing there, a kind that is not known, a part that is missing or too much, or a file
            of another kind than its suffix.
    """
    if is_of_views(path):
        return read_views(path, where)
    if is_bag(path) and (is_file(path) or is_folder(path)):
        if not part and not is_echo(path):
            raise InputError(f"{where}: {path.name} is a bag; name the topic with `part`")
        if (frames := frames_of(part)) is not None:
            return read_transform_table(path, *frames, where)
        return read_topic_table(path, part, where)
    if is_lerobot(path):
        return read_lerobot_table(path, part, where)
    if is_folder(path):
        raise InputError(f"{where}: folder {path} is neither a bag (metadata.yaml) nor a LeRobot dataset")
    if not is_file(path):
        raise InputError(f"{where}: no file {path}; --data names the folder that paths count from")
    suffix = path.suffix.lower()
    found = next((each for each in FORMATS if suffix in each.suffixes), None)
    if found is None and is_text_table(path):
        found = FORMATS[0]
    if found is None:
        raise InputError(
            f"{where}: {path.name} is of unknown kind; use {', '.join(SUFFIXES)}, a table in text under any"
            f" name, a bag or a LeRobot dataset{remedy_of([path])}"
        )
    if part and not found.parts:
        raise InputError(f"{where}: a {suffix} file has no parts, so no {part!r}; leave `part` out")
    try:
        return found.read(path, part, options, where)
    except _UNREADABLE as error:
        raise InputError(f"{where}: {path} cannot be read as {suffix}: {error}") from error
