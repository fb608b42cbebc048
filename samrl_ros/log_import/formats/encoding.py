"""Text of tables as tools write it: UTF-8, UTF-16 with its mark, or what Windows in the West writes."""

from __future__ import annotations

import codecs
from pathlib import Path


def decoded_text(path: Path) -> str:
    """Text of a file, ends of lines as they are.

    Bytes that are no UTF-8 are taken as Latin-1: an umlaut in a title or a degree sign in a unit is no reason
    to refuse numbers, which are the same in both.

    Args:
        path: of the file.

    Raises:
        OSError: the file cannot be read.
        ValueError: it holds zero bytes, as no text does, or a broken UTF-16.
    """
    content = path.read_bytes()
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return content.decode("utf-16")
    if b"\0" in content:
        raise ValueError("it holds zero bytes, which no text does")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")
