"""Text, JSON and YAML that others wrote: whatever the bytes are, a value or an `InputError`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import yaml

from samrl_core.common.errors import InputError
from samrl_core.common.files import read_whole

MAX_TEXT_BYTES = 64 << 20  # of a description, a mapping or a report
_DEEPEST = 60  # levels of a YAML or JSON document; ours have fewer than ten
_MOST_NODES = 1_000_000  # of a YAML document with its aliases written out
# What PyYAML's constructors raise on values that do not fit their tags, besides its own errors.
_UNREADABLE_YAML = (
    yaml.YAMLError,
    ValueError,
    TypeError,
    KeyError,
    IndexError,
    AttributeError,
    OverflowError,
    RecursionError,
)


def read_text(path: Path, what: str, most: int = MAX_TEXT_BYTES) -> str:
    """Content of a text file; a byte order mark is left out.

    Args:
        path: of the file.
        what: it is, for messages, e.g. "the mapping".
        most: bytes that it may have.

    Raises:
        InputError: no such file, a pipe or folder, too large, or not UTF-8.
    """
    try:
        return decoded(read_whole(path, most), str(path))
    except InputError as error:
        raise InputError(f"{what}: {error}") from error


def decoded(content: bytes, where: str) -> str:
    """UTF-8 bytes as text. Raises `InputError` naming the place and, where it shows, the encoding."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        kind = "UTF-16" if content[:2] in (b"\xff\xfe", b"\xfe\xff") else "another encoding"
        raise InputError(
            f"{where} is no UTF-8 text: byte {error.start} is 0x{content[error.start]:02x}, as of {kind};"
            " save it as UTF-8"
        ) from error


def parse_json(text: str, where: str) -> Any:
    """The value of a JSON text. Raises `InputError`: no JSON, or nested too deeply."""
    try:
        value = json.loads(text)
    except RecursionError as error:
        raise InputError(f"{where} is nested too deeply; at most {_DEEPEST} levels are read") from error
    except ValueError as error:
        raise InputError(f"{where} is no JSON: {error}") from error
    _check_depth(value, where)
    return value


def parse_yaml(text: str, where: str, loader: type[yaml.SafeLoader] = yaml.SafeLoader) -> Any:
    """The value of a YAML text, None for an empty one.

    Raises:
        InputError: no YAML, values that do not fit their tags, nested too deeply, or aliases that contain
            themselves or multiply to more than a million values.
    """
    try:
        reader = loader(text)
        try:
            node = reader.get_single_node()
            if node is None:
                return None
            _check_aliases(node, where)
            return reader.construct_document(node)
        finally:
            reader.dispose()
    except RecursionError as error:
        raise InputError(f"{where} is nested too deeply; at most {_DEEPEST} levels are read") from error
    except _UNREADABLE_YAML as error:
        raise InputError(f"{where} is no YAML: {' '.join(str(error).split())[:500]}") from error


def _check_depth(value: Any, where: str) -> None:
    level = [value]
    for _ in range(_DEEPEST):
        level = [inner for each in level if isinstance(each, (dict, list)) for inner in _inside(each)]
        if not level:
            return
    raise InputError(f"{where} is nested too deeply; at most {_DEEPEST} levels are read")


def _inside(value: dict[str, Any] | list[Any]) -> list[Any]:
    return list(value.values()) if isinstance(value, dict) else value


def _check_aliases(root: yaml.Node, where: str) -> None:
    sizes: dict[int, int] = {}

    def size(node: yaml.Node, above: tuple[int, ...]) -> int:
        if id(node) in above:
            raise InputError(f"{where}: an alias contains itself; write the values out")
        if len(above) >= _DEEPEST:
            raise InputError(f"{where} is nested too deeply; at most {_DEEPEST} levels are read")
        if id(node) not in sizes:
            inner: list[yaml.Node] = []
            if isinstance(node, yaml.MappingNode):
                inner = [each for pair in node.value for each in pair]
            elif isinstance(node, yaml.SequenceNode):
                inner = node.value
            sizes[id(node)] = 1 + sum(size(each, (*above, id(node))) for each in inner)
        return sizes[id(node)]

    if size(root, ()) > _MOST_NODES:
        raise InputError(f"{where} grows to more than {_MOST_NODES} values by its aliases; write fewer")
