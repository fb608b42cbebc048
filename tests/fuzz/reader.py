"""What reads bytes from outside, as the attack sees it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Reader:
    """What reads bytes: from a file of a name in an empty folder."""

    name: str
    file: str
    sound: Callable[[], list[bytes]]  # inputs to start from
    read: Callable[[Path], Any]
    share: float = 1.0  # of the inputs that a reader gets, for one that takes long
    prepare: Callable[[Path], Any] = lambda path: None  # puts beside the file what belongs to it


def text_reader(function: Callable[[str], Any]) -> Callable[[Path], Any]:
    """For readers that get text from a message: what is no UTF-8 never reaches them."""

    def read(path: Path) -> Any:
        try:
            text = path.read_bytes().decode()
        except UnicodeDecodeError:
            return None
        return function(text)

    return read
