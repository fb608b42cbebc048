"""A file for each view, as scripts that calibrate a camera write them: `pose_000.txt`, `pose_001.txt`, ...

A path with a star, `pose_*.txt` or `view_*/pose.json`, stands for all of them, each a row of one table. A
row's time is the number in its file's name, so that files of the arm and files of the camera are paired by
it, whichever are missing.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.common.array_file import UNREADABLE
from samrl_core.common.errors import InputError
from samrl_core.common.files import is_file, is_folder
from samrl_core.common.text_files import parse_json
from samrl_ros.log_import.formats.encoding import decoded_text
from samrl_ros.log_import.table import Table, rows_as_column

STAR = "*"
LEAST = 6  # files that differ in their number and are views
_SUFFIXES = (".txt", ".csv", ".json", ".npy", ".npz")
_NUMBER = re.compile(r"\d+")
_APART = re.compile(r"[\s,;\[\]()]+")
_LARGEST = 1 << 16  # bytes of a file that holds one sample
_OF_A_POSE = (6, 7, 9, 12, 16)  # numbers of a text that is one pose


def is_of_views(path: Path) -> bool:
    """Whether a path stands for a file per view."""
    return STAR in path.name or STAR in path.parent.name


def name_of_file(path: Path) -> str:
    """How a mapping names a file beside it, or the files that a path with a star stands for."""
    return f"{path.parent.name}/{path.name}" if STAR in path.parent.name else path.name


def files_of_views(path: Path) -> list[tuple[int, Path]]:
    """The files that a path with a star stands for, by the number in its place."""
    starred = path if STAR in path.name else path.parent
    before, _, after = starred.name.partition(STAR)
    like = re.compile(rf"{re.escape(before)}(\d+){re.escape(after)}")
    found = [(m, each) for each in starred.parent.glob(starred.name) if (m := like.fullmatch(each.name))]
    files = [(int(m[1]), each if starred is path else each / path.name) for m, each in found]
    return sorted((number, file) for number, file in files if is_file(file))


def find_views(files: Sequence[Path]) -> list[Path]:
    """Paths with a star for files, or folders of files, that differ in a number and hold one sample each."""
    alike: dict[Path, list[Path]] = {}
    for file in files:
        numbers = list(_NUMBER.finditer(file.stem))
        if not numbers:
            continue
        last = numbers[-1]
        stem = f"{file.stem[: last.start()]}{STAR}{file.stem[last.end() :]}{file.suffix}"
        for one in sorted(file.iterdir()) if is_folder(file) else [file]:
            if one.suffix.lower() in _SUFFIXES:
                like = file.with_name(stem)
                alike.setdefault(like if one is file else like / one.name, []).append(one)
    return [path for path, there in alike.items() if len(there) >= LEAST and _is_one_sample(there[0])]


def read_views(path: Path, where: str) -> Table:
    """A row per file: the numbers of a text as one list, the lists of a JSON or NPZ file by their keys.

    Raises:
        InputError: no such files, one that cannot be read, or files that hold other numbers than the first.
    """
    files = files_of_views(path)
    if not files:
        raise InputError(f"{where}: no file like {path}; {STAR} stands for the number of a view")
    rows = [dict(_sample(file, where)) for _, file in files]
    table = Table(path, time=np.array([float(number) for number, _ in files]))
    for name in dict.fromkeys(name for row in rows for name in row):
        array = rows_as_column([row.get(name) for row in rows])
        if array is not None:
            table.columns[name] = array
        elif not isinstance(rows[0].get(name), str):
            counts = [np.size(row.get(name, [])) for row in rows]
            odd = next((k for k, count in enumerate(counts) if count != counts[0]), 0)
            raise InputError(
                f"{where}: {files[odd][1].name} holds {counts[odd]} numbers as {name!r},"
                f" {files[0][1].name} {counts[0]}; each view needs as many"
            )
    return table


def _is_one_sample(file: Path) -> bool:
    if file.stat().st_size > _LARGEST:
        return False
    try:
        sample = dict(_sample(file, "it"))
    except InputError:
        return False
    sizes = [np.size(value) for value in sample.values() if not isinstance(value, str)]
    text = file.suffix.lower() in (".txt", ".csv")
    return bool(sizes) and (
        sizes[0] in _OF_A_POSE if text else any(size in (3, *_OF_A_POSE) for size in sizes)
    )


def _sample(file: Path, where: str) -> Iterator[tuple[str, Any]]:
    """Names and lists of numbers of one file."""
    suffix = file.suffix.lower()
    try:
        if suffix in (".npy", ".npz"):
            with file.open("rb") as stream:
                loaded = np.load(stream, allow_pickle=False)
                arrays = dict(loaded) if suffix == ".npz" else {_word_of(file): loaded}
            yield from ((k, np.ravel(v).tolist()) for k, v in arrays.items() if v.dtype.kind in "fi")
        elif suffix == ".json":
            yield from _leaves(parse_json(decoded_text(file), str(file)))
        else:
            words = [word for word in _APART.split(decoded_text(file)) if word]
            yield _word_of(file), [float(word) for word in words]
    except (*UNREADABLE, OSError, ValueError) as error:
        raise InputError(f"{where}: {file.name} cannot be read as one view: {error}") from error


def _word_of(file: Path) -> str:
    """What the numbers of a file without names are of: its name without the number."""
    return _NUMBER.sub("", file.stem).strip("_-. ") or "pose"


def _leaves(value: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Numbers, and lists of numbers however deep, by their keys."""
    if not isinstance(value, dict):
        return
    for key, each in value.items():
        if isinstance(each, dict):
            yield from _leaves(each, f"{prefix}{key}.")
        elif isinstance(each, list) and (flat := _flat(each)):
            yield f"{prefix}{key}", flat


def _flat(value: list[Any]) -> list[float]:
    """All numbers of nested lists; empty where anything else is in them."""
    out: list[float] = []
    for each in value:
        inner = _flat(each) if isinstance(each, list) else [each]
        if not inner or not all(isinstance(x, int | float) and not isinstance(x, bool) for x in inner):
            return []
        out += inner
    return out
