"""Files that are there whole or not at all, also when the process is killed in between."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from samrl_core.common.errors import InputError


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a file so that at any instant `path` holds the old content or the new one.

    The folder is made if it is missing; text is written as UTF-8. The content is on the disk before it gets
    its name.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    half = path.with_name(f"{path.name}.{os.getpid()}.half")
    try:
        with half.open("wb") as file:
            file.write(content.encode() if isinstance(content, str) else content)
            file.flush()
            os.fsync(file.fileno())
        half.replace(path)
    finally:
        half.unlink(missing_ok=True)


def read_whole(path: Path, most: int) -> bytes:
    """Content of a file.

    Args:
        path: of the file.
        most: bytes that such a file can have.

    Raises:
        InputError: there is none, it cannot be read, is larger, or is something that is no file: opening a
            pipe would wait for ever.
    """
    try:
        found = path.stat()
        if stat.S_ISREG(found.st_mode) and found.st_size <= most:
            return path.read_bytes()
    except (OSError, ValueError) as error:  # a null byte in the path is a ValueError
        raise InputError(f"cannot read {path}: {error}; check the path") from error
    if not stat.S_ISREG(found.st_mode):
        raise InputError(f"cannot read {path}: it is no file; check the path")
    raise InputError(f"{path} has {found.st_size} bytes, such a file at most {most}; check the path")
