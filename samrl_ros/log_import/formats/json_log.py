"""JSON: a list of samples, an object of lists, or a sample per line (.jsonl)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from samrl_core.common.errors import InputError
from samrl_core.common.text_files import parse_json, read_text
from samrl_ros.log_import.table import Table, rows_as_column


def read_json_table(path: Path, part: str, where: str) -> Table:
    """Numbers and lists of numbers by key, nested keys joined by dots.

    Args:
        path: of the file.
        part: keys down to the samples, joined by dots; empty for all of the file.
        where: key path, for messages.

    Raises:
        InputError: no JSON, no such part, or no samples in it.
    """
    text = read_text(path, where)
    if path.suffix.lower() == ".jsonl":
        content: Any = [
            parse_json(line, f"{path}, line {number}")
            for number, line in enumerate(text.splitlines(), 1)
            if line.strip()
        ]
    else:
        content = parse_json(text, str(path))
    for key in filter(None, part.split(".")):
        if isinstance(content, list) and key.isdecimal() and int(key) < len(content):
            content = content[int(key)]
        elif isinstance(content, dict) and key in content:
            content = content[key]
        else:
            present = list(content) if isinstance(content, dict) else f"a {type(content).__name__}"
            raise InputError(f"{where}: {path.name} has no {key!r} of part {part!r}; there is {present}")
    samples = content if isinstance(content, list) else None
    columns: dict[str, list[Any]] = {}
    if samples is not None and samples and all(isinstance(sample, dict) for sample in samples):
        for k, sample in enumerate(samples):
            for name, value in _leaves(sample):
                columns.setdefault(name, [None] * len(samples))[k] = value
    elif isinstance(content, dict):
        columns = {name: value for name, value in _leaves(content) if isinstance(value, list)}
    else:
        raise InputError(
            f"{where}: {path.name} must be a list of objects, or an object of lists; it is"
            f" {json.dumps(content)[:80]}; `part` names the keys down to the samples"
        )
    table = Table(path)
    for name, values in columns.items():
        array = rows_as_column(values)
        if array is not None:
            table.columns[name] = array
    return table


def _leaves(value: dict[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    found = []
    for key, each in value.items():
        name = f"{prefix}{key}"
        found += _leaves(each, f"{name}.") if isinstance(each, dict) else [(name, each)]
    return found
