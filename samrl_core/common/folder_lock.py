"""One process at a time in a folder: a lock that the operating system gives back when its holder ends."""

from __future__ import annotations

import fcntl
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from samrl_core.common.errors import InputError

LOCK = ".lock"  # the file in the folder; empty, and left there: removing it would let two in
_RETRY_S = 0.05


@contextmanager
def folder_lock(folder: Path, wait_s: float = 0.0) -> Iterator[None]:
    """Keep other processes out of a folder for as long as the block runs, or this process, killed or not.

    The lock is advisory (flock(2)): it holds between those that ask for it. Child processes do not inherit
    it: Python's files are closed in them.

    Args:
        folder: made if it is missing.
        wait_s: how long to wait for another one to end [s].

    Raises:
        InputError: another process, or another block of this one, is at work there; or the file system knows
            no locks.
    """
    folder.mkdir(parents=True, exist_ok=True)
    until = time.monotonic() + wait_s
    with (folder / LOCK).open("ab") as file:
        while not _taken(file.fileno(), folder):
            if time.monotonic() >= until:
                raise InputError(
                    f"another process is at work in {folder.resolve()}; wait until it has ended, or take "
                    f"another folder"
                )
            time.sleep(_RETRY_S)
        yield


def _taken(descriptor: int, folder: Path) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        raise InputError(
            f"cannot lock {folder.resolve()} ({error}); take a folder on a file system with locks"
        ) from error
    return True
