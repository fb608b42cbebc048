"""Files that stay whole when a process is killed or the disk is full, settings of a folder, and its lock."""

from __future__ import annotations

import errno
import json
import os
import shutil
import stat
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import filelock

from samrl_core.common.errors import InputError

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)  # disk full, quota used up, `ulimit -f`
LOCK = ".lock"  # the file in the folder; empty, and left there: removing it would let two in


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a file so that at any instant `path` holds the old content or the new one.

    The folder is made if it is missing; text is written as UTF-8. A byte of a file's name that is no UTF-8
    (an archive of Windows unpacked here) is written as Python shows it, `\\udcfc`. The content is on the
    disk before it gets its name.

    Raises:
        InputError: there is no room; `path` is as it was.
    """
    half = path.with_name(f"{path.name}.{os.getpid()}.half")
    with room_for(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with half.open("wb") as file:
                file.write(_encoded(content) if isinstance(content, str) else content)
                file.flush()
                os.fsync(file.fileno())
            half.replace(path)
        finally:
            half.unlink(missing_ok=True)


def append_line(path: Path, line: str, outlives_power: bool = True) -> None:
    """Add a line to a text file, which is made if it is missing.

    Args:
        path: of the file.
        line: without its end.
        outlives_power: it is on the disk when this returns, which takes a while; else the system has it.

    Raises:
        InputError: there is no room; the file is as it was, without a part of the line.
    """
    with room_for(path), path.open("ab", buffering=0) as file:
        before = file.seek(0, os.SEEK_END)
        try:
            left = memoryview(_encoded(f"{line}\n"))
            while left:  # a nearly full disk takes a part before it refuses
                left = left[file.write(left) :]
            if outlives_power:
                os.fsync(file.fileno())
        except OSError:
            file.truncate(before)
            raise


def _encoded(text: str) -> bytes:
    return text.encode(errors="backslashreplace")


@contextmanager
def room_for(path: Path) -> Generator[None]:
    """Within the block a file or folder is written; that there is no room for it becomes a refusal.

    Raises:
        InputError: naming path, free bytes and remedy. Other errors of the system pass.
    """
    try:
        yield
    except OSError as error:
        if error.errno not in NO_ROOM:
            raise
        raise InputError(no_room(path, error)) from error


def no_room(path: Path, error: OSError) -> str:
    """What to say where a file has no room."""
    there = next(folder for folder in (path.absolute(), *path.absolute().parents) if folder.is_dir())
    free = shutil.disk_usage(there).free
    return (
        f"cannot write {path}: {error.strerror}; {free} bytes are free at {there}."
        f" Make room there, or give a folder on another disk"
    )


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
        # The system's error has the path and a number as well; a ValueError is its own text.
        why = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise InputError(f"cannot read {path}: {why}; check the path") from error
    if not stat.S_ISREG(found.st_mode):
        raise InputError(f"cannot read {path}: it is no file; check the path")
    raise InputError(f"{path} has {found.st_size} bytes, such a file at most {most}; check the path")


def check_folder(path: Path) -> None:
    """That a folder can be made there, or is there and can be written: asked before long work, not after it.

    Raises:
        InputError: a file is in the way, or the folder that it would lie in cannot be written.
    """
    there = next((each for each in (path, *path.absolute().parents) if is_there(each)), Path("/"))
    if not is_folder(there):
        raise InputError(f"cannot write to {path}: {there} is a file; give another --out")
    if not os.access(there, os.W_OK | os.X_OK):
        raise InputError(f"cannot write to {path}: {there} may not be written; give another --out")


def is_file(path: Path) -> bool:
    """Whether a plain file lies there: no folder, no pipe, and not a path that no file can have."""
    return _kind_of(path) == stat.S_IFREG


def is_folder(path: Path) -> bool:
    """Whether a folder lies there."""
    return _kind_of(path) == stat.S_IFDIR


def is_there(path: Path) -> bool:
    """Whether anything lies there; nothing does at a path that the system refuses (too long)."""
    return _kind_of(path) != 0


def require_there(*logs: Path) -> None:
    """Refuse paths where nothing lies. Raises `InputError`, naming the first."""
    for path in logs:
        if not is_there(path):
            raise InputError(f"{path} does not exist; give a bag, a folder of bags or a log")


def _kind_of(path: Path) -> int:
    try:
        return stat.S_IFMT(path.stat().st_mode)
    except (OSError, ValueError):
        return 0


def keep_to(
    path: Path,
    wanted: dict[str, Any],
    what: str,
    note: dict[str, str],
    before: dict[str, Any] | None = None,
) -> dict[str, str]:
    """Write settings into a folder that has none, or hold them against those that are there.

    Args:
        path: of the file.
        wanted: settings; nested ones are named with dots, so that a refusal can name the one that differs.
        what: is in the folder, e.g. "training".
        note: written beside them, and not compared.
        before: settings that older folders do not name, by the value that they were made with.

    Returns:
        The note that is in the file, with empty texts for what is missing.

    Raises:
        InputError: the file cannot be read, or holds other settings.
    """
    wanted = json.loads(json.dumps(_flat(wanted), default=str))
    if not path.exists():
        write_whole(path, json.dumps({**note, **wanted}, indent=1) + "\n")
        return note
    try:
        found = {**(before or {}), **json.loads(path.read_text())}
    except (ValueError, TypeError) as error:
        raise InputError(f"{path} cannot be read ({error}); take another folder") from error
    noted = {name: str(found.pop(name, "")) for name in note}
    different = [k for k in {**wanted, **found} if wanted.get(k) != found.get(k)]
    if different:
        listed = ", ".join(f"{k} {found.get(k)!r} (asked for: {wanted.get(k)!r})" for k in different)
        raise InputError(
            f"{path.parent} holds another {what}: {listed}; take another folder, or ask for the same to go on"
        )
    return noted


@contextmanager
def folder_lock(folder: Path, wait_s: float = 0.0) -> Generator[None]:
    """Keep other processes out of a folder while the block runs; the system frees it when the process ends.

    The lock is advisory (flock(2)): it holds between those that ask for it. Child processes do not
    inherit it.

    Args:
        folder: made if it is missing.
        wait_s: how long to wait for another one to end [s].

    Raises:
        InputError: another process, or another block of this one, is at work there; or the file system knows
            no locks.
    """
    folder.mkdir(parents=True, exist_ok=True)
    lock = filelock.FileLock(folder / LOCK, timeout=wait_s, fallback_to_soft=False)
    try:
        held = lock.acquire()
    except filelock.Timeout as error:
        raise InputError(
            f"another process is at work in {folder.resolve()}; wait until it has ended, or take "
            "another folder"
        ) from error
    except OSError as error:
        raise InputError(
            f"cannot lock {folder.resolve()} ({error}); take a folder on a file system with locks"
        ) from error
    with held:
        yield


def _flat(values: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in values.items():
        flat |= _flat(value, f"{prefix}{name}.") if isinstance(value, dict) else {f"{prefix}{name}": value}
    return flat
