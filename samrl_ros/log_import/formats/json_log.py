"""JSON: a list of samples, an object of lists, or a sample per line (.jsonl)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from samrl_core.common.text_files import parse_json, read_text
from samrl_ros.log_import.formats.nested import table_of_nested
from samrl_ros.log_import.table import Table


def read_json_table(path: Path, part: str, where: str) -> Table:
    """Numbers and lists of numbers by key, as `table_of_nested` finds them.

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
    return table_of_nested(content, path, part, where)
