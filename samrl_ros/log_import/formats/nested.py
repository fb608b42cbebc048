"""Samples in nested content, as JSON and YAML hold it: columns of numbers by key."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pandas as pd

from samrl_core.common.errors import InputError
from samrl_ros.log_import.table import Table, rows_as_column

_NUMBERED = re.compile(r"(.*?)[_.]?(\d+)")
_OF_A_POSE = (3, 6, 7, 9, 12, 16)  # numbers
_LONGEST_POSE = 16  # numbers; a longer list is of samples
_FEWEST = 3  # keys alike that are samples; fewer are parts of one thing, such as two arms


def table_of_nested(content: Any, path: Path, part: str, where: str) -> Table:
    """Numbers, lists of numbers and texts beside them by key, nested keys joined by dots.

    Samples are a list of objects, an object of lists, objects under keys of their own (`pose_0`, `pose_1`),
    values under numbered keys (`T1_0`, `T1_1` give `T1`), or bare lists (`data`). Below the top they are
    found without `part` where nothing else holds samples.

    Args:
        content: of the file.
        path: of the file.
        part: keys down to the samples, joined by dots; empty for all of the file.
        where: key path, for messages.

    Raises:
        InputError: no such part, or no samples in it.
    """
    for key in filter(None, part.split(".")):
        if isinstance(content, list) and key.isdecimal() and int(key) < len(content):
            content = content[int(key)]
        elif isinstance(content, dict) and key in content:
            content = content[key]
        else:
            present = list(content) if isinstance(content, dict) else f"a {type(content).__name__}"
            raise InputError(f"{where}: {path.name} has no {key!r} of part {part!r}; there is {present}")
    content = _samples_in(content)
    episodes = _are_episodes(content)
    content = content[0] if episodes else content
    columns: dict[str, list[Any]] = {}
    if isinstance(content, list) and content and all(isinstance(sample, dict) for sample in content):
        for k, sample in enumerate(content):
            for name, value in _leaves(sample):
                columns.setdefault(name, [None] * len(content))[k] = value
        columns = _apart(columns)
    elif isinstance(content, list) and content and all(isinstance(sample, list) for sample in content):
        columns = {"data": content}
    elif isinstance(content, dict):
        leaves = [(name, value) for name, value in _leaves(content) if isinstance(value, list)]
        stacked, single = _numbered(leaves)
        columns = stacked | {name: value for name, value in leaves if name not in single}
    else:
        raise InputError(
            f"{where}: {path.name} must be a list of objects, or an object of lists; it is"
            f" {json.dumps(content, default=str)[:80]}; `part` names the keys down to the samples"
        )
    table = Table(path)
    if episodes > 1:
        table.notes.append(f"{path.name} holds {episodes} episodes; the first is read, `part` names others")
    for name, values in columns.items():
        array = rows_as_column([_matrix(value) for value in values])
        if array is not None:
            table.columns[name] = array
    lengths = {len(values) for values in table.columns.values()}
    for name, values in columns.items():  # texts beside numbers: whose a sample is, or a date
        if len(values) in lengths and {type(value) for value in values} in ({str}, {str, type(None)}):
            table.columns[name] = pd.Series(values, dtype=object)
    return table


def _apart(columns: dict[str, list[Any]]) -> dict[str, list[Any]]:
    """Columns whose every sample is as many objects, an actuator each: a column of each, `actuators.0.q`."""
    out: dict[str, list[Any]] = {}
    for name, values in columns.items():
        counts = {
            len(v) if isinstance(v, list) and all(isinstance(e, dict) for e in v) else 0 for v in values
        }
        if len(counts) != 1 or counts == {0}:
            out[name] = values
            continue
        for k, sample in enumerate(values):
            for number, each in enumerate(sample):
                for key, value in _leaves(each, f"{name}.{number}."):
                    out.setdefault(key, [None] * len(values))[k] = value
    return out


def _are_episodes(content: Any) -> int:
    """How many episodes a list holds, objects of lists of one length; 0 of a list of samples."""
    if not isinstance(content, list) or not content or not all(isinstance(e, dict) for e in content):
        return 0
    for each in content:
        lists = [v for _, v in _leaves(each) if isinstance(v, list)]
        longest = [len(v) for v in lists if len(v) > _LONGEST_POSE]
        if not longest or longest.count(longest[0]) != len(longest):
            return 0
    return len(content)


def _samples_in(content: Any) -> Any:
    """Where the samples begin: beneath a single key that holds objects, or as values of keys alike."""
    while isinstance(content, dict):
        if (samples := _samples_of(content)) is not None:
            return samples
        lists = [v for v in content.values() if isinstance(v, list) and v]
        objects = [v for v in content.values() if isinstance(v, dict) and not _is_matrix(v)]
        below = [v for v in lists if isinstance(v[0], dict)]
        if len(lists) == 1 and below and not any(_samples_of(v) for v in objects):
            return below[0]
        if lists or len(objects) != 1 or len(content) != 1:
            return content
        content = objects[0]
    return content


def _samples_of(content: dict[str, Any]) -> list[Any] | None:
    """Values of keys that hold the same keys each, in the order of their numbers; None if they do not."""
    values = list(content.values())
    if len(values) >= _FEWEST and all(_is_listed_object(v) for v in values):
        content = {key: value[0] for key, value in content.items()}  # BOP's scene_gt.json: objects by image
        values = list(content.values())
    if len(values) < _FEWEST or not all(isinstance(v, dict) and v and not _is_matrix(v) for v in values):
        return None
    numbered = [_NUMBERED.fullmatch(str(key)) for key in content]
    if not all(numbered) or len({m[1] for m in numbered if m}) != 1:
        return None
    if len({tuple(sorted(map(str, v))) for v in values}) != 1:
        return None
    order = sorted(zip((int(m[2]) for m in numbered if m), values, strict=True), key=lambda one: one[0])
    return [value for _, value in order]


def _is_listed_object(value: Any) -> bool:
    """Whether it is a list of one object; of several in an image nothing says which is meant."""
    return isinstance(value, list) and len(value) == 1 and isinstance(value[0], dict)


def _numbered(leaves: list[tuple[str, Any]]) -> tuple[dict[str, list[Any]], set[str]]:
    """Poses under names that differ in their last number, as samples of one column; and these names."""
    found: dict[str, dict[int, tuple[str, list[Any]]]] = {}
    for name, value in leaves:
        match = _NUMBERED.fullmatch(name)
        if match and match[1] and _count(value) in _OF_A_POSE:
            found.setdefault(match[1], {})[int(match[2])] = name, value
    whole = {
        stem: [values[k] for k in sorted(values)]
        for stem, values in found.items()
        if len(values) >= _FEWEST and len({_count(value) for _, value in values.values()}) == 1
    }
    names = {name for values in whole.values() for name, _ in values}
    return {stem: [value for _, value in values] for stem, values in whole.items()}, names


def _count(value: list[Any]) -> int:
    """Numbers in a list, or in a list of lists."""
    return sum(len(each) if isinstance(each, list) else 1 for each in value)


def _is_matrix(value: Any) -> bool:
    """Whether an object is a matrix as OpenCV stores one."""
    return isinstance(value, dict) and {"rows", "cols", "data"} <= set(value)


def _matrix(value: Any) -> Any:
    """The rows of a matrix as OpenCV stores one; anything else as it is."""
    if not _is_matrix(value) or not isinstance(value["data"], list):
        return value
    rows, width, data = value["rows"], value["cols"], value["data"]
    if not (isinstance(rows, int) and isinstance(width, int) and rows * width == len(data) and width > 0):
        return value
    return data if rows == 1 else [data[k : k + width] for k in range(0, len(data), width)]


def _leaves(value: dict[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    found = []
    for key, each in value.items():
        name = f"{prefix}{key}"
        if isinstance(each, dict) and not _is_matrix(each):
            found += _leaves(each, f"{name}.")
        else:
            found.append((name, _matrix(each)))
    return found
