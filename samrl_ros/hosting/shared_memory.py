"""Shared memory of Fast DDS that killed processes left behind: found by its locks, and removed.

A living participant holds a lock (flock(2)) on the lock file of each of its segments (`_el`) and ports
(`_el`, or `_sl` when several listen); the system frees it whatever ends the process. That is how
`fastdds shm clean` knows them too. A lock file is made before it is locked, so young ones are left alone.
"""

from __future__ import annotations

import fcntl
import os
import re
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

SHARED_MEMORY = Path("/dev/shm")
YOUNG_S = 10.0  # [s] a participant that is just starting
_LOCK = re.compile(r"(fast(?:rtps|dds)_(?:[0-9a-z]{16}|port\d{1,5}))_(?:el|sl)")


@dataclass(frozen=True)
class Leftover:
    """A segment or port without an owner."""

    name: str
    size: int  # [bytes] that it takes


def leftovers(folder: Path = SHARED_MEMORY, young_s: float = YOUNG_S) -> tuple[Leftover, ...]:
    """What nobody alive owns, of this user's."""
    return tuple(_each(folder, young_s, remove=False))


def remove_leftovers(folder: Path = SHARED_MEMORY, young_s: float = YOUNG_S) -> tuple[Leftover, ...]:
    """Remove what nobody alive owns, of this user's; returns what is gone."""
    return tuple(_each(folder, young_s, remove=True))


def _each(folder: Path, young_s: float, remove: bool) -> Iterator[Leftover]:
    locks: dict[str, list[Path]] = {}
    for path in sorted(folder.iterdir()) if folder.is_dir() else ():
        if found := _LOCK.fullmatch(path.name):
            locks.setdefault(found[1], []).append(path)
    for name, files in locks.items():
        if all(_is_ours_and_old(file, young_s) for file in files):
            with ExitStack() as held:
                if not all(_locked(file, held) for file in files):
                    continue
                data = folder / name
                size = data.stat().st_blocks * 512 if data.is_file() else 0
                if remove:  # the locks last: without them nobody finds the rest again
                    for gone in (data, folder / f"sem.{name}_mutex", *files):
                        gone.unlink(missing_ok=True)
                yield Leftover(name, size)


def _is_ours_and_old(file: Path, young_s: float) -> bool:
    try:
        found = file.lstat()
    except FileNotFoundError:
        return False
    return found.st_uid == os.getuid() and time.time() - found.st_mtime >= young_s


def _locked(file: Path, held: ExitStack) -> bool:
    """Take a lock for as long as `held`; False where a living process has it."""
    try:
        stream = held.enter_context(file.open("rb"))
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:  # held by its owner, or gone
        return False
    return True
