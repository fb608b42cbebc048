"""YAML: samples of calibration tools (easy_handeye, MoveIt), and OpenCV's matrices (`FileStorage`)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml
from yaml.constructor import ConstructorError

from samrl_core.common.errors import InputError
from samrl_core.common.text_files import parse_yaml, read_text
from samrl_ros.log_import.formats.nested import table_of_nested
from samrl_ros.log_import.table import Table


class _Loader(yaml.SafeLoader):
    """Plain values, and OpenCV's matrices as objects of rows, cols and data."""


def _opencv_matrix(loader: _Loader, node: yaml.Node) -> Any:
    if not isinstance(node, yaml.MappingNode):
        raise ConstructorError(None, None, "a matrix is no mapping", node.start_mark)
    return loader.construct_mapping(node, deep=True)


for _tag in ("tag:yaml.org,2002:opencv-matrix", "!opencv-matrix"):
    _Loader.add_constructor(_tag, _opencv_matrix)


def read_yaml_content(text: str, where: str) -> Any:
    """What a text holds, OpenCV's too. Raises `InputError` where it is no YAML."""
    lines = text.splitlines()
    if lines and lines[0].startswith("%YAML:"):  # OpenCV's first line, which is no YAML
        lines = lines[1:]
    return parse_yaml("\n".join(lines), where, _Loader)


def read_yaml_table(path: Path, part: str, where: str) -> Table:
    """Numbers and lists of numbers by key, as `table_of_nested` finds them.

    Raises:
        InputError: no YAML, no such part, or no samples in it.
    """
    table = table_of_nested(read_yaml_content(read_text(path, where), str(path)), path, part, where)
    if not table.columns:
        raise InputError(f"{where}: {path.name} holds no samples; `part` names the keys down to them")
    return table
