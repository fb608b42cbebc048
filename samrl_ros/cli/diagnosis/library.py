"""`--library FILE`: families that a diagnosis may name."""

from __future__ import annotations

from pathlib import Path

from samrl_core.common.errors import InputError
from samrl_core.common.text_files import parse_yaml, read_text


def read_library(path: Path) -> tuple[str, ...]:
    """Families that may be named: YAML or JSON, a list or `families: [...]`.

    Raises:
        InputError: the file cannot be read, or holds no list of names.
    """
    try:
        content = parse_yaml(read_text(path, "the library"), str(path))
    except InputError as error:
        raise InputError(f"library {path} cannot be read: {error}") from error
    names = content.get("families") if isinstance(content, dict) else content
    if not isinstance(names, list) or not names or not all(isinstance(n, str) for n in names):
        raise InputError(f"library {path} must list families, plain or under `families:`; see samrl effects")
    return tuple(names)
