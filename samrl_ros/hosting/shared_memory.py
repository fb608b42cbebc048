"""Shared memory of Fast DDS that killed processes left behind: found by its locks, passed over, and removed.

A living participant holds a lock (flock(2)) on the lock file of each of its segments (`_el`) and ports
(`_el`, or `_sl` when several listen); the system frees it whatever ends the process. That is how
`fastdds shm clean` knows them too. A lock file is made before it is locked, so young ones are left alone.

A port outlives its listener in the writers that opened it. The next process of the same port number makes
a port file of the same name, and a writer goes over to it only once its watchdog has called the old one
dead. It does where the listener was killed waiting for a message or handling one, and never where that was
between the two (Fast DDS 2.14; its issues 5053 and 5469): the successor is deaf, and so is each after it.
Hence no port number of a killed process is used again while a writer holds it: `pass_over_dead_ports`.
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
FIRST_PORT = 7411  # of messages, in domain 0 (RTPS 9.6.2.3); below it Fast DDS counts participants
_PORT_LOCK = re.compile(r"fast(?:rtps|dds)_port(\d{1,5})_el")
_passed_over: list[ExitStack] = []  # locks of dead ports, held until this process ends
_LOCK = re.compile(r"(fast(?:rtps|dds)_(?:[0-9a-z]{16}|port\d{1,5}))_(?:el|sl)")


@dataclass(frozen=True)
class Leftover:
    """A segment or port without an owner."""

    name: str
    size: int  # [bytes] that it takes


def leftovers(folder: Path = SHARED_MEMORY, young_s: float = YOUNG_S) -> tuple[Leftover, ...]:
    """What nobody alive owns or writes to, of this user's."""
    return tuple(_each(folder, young_s, remove=False))


def remove_leftovers(folder: Path = SHARED_MEMORY, young_s: float = YOUNG_S) -> tuple[Leftover, ...]:
    """Remove what nobody alive owns or writes to, of this user's; returns what is gone."""
    return tuple(_each(folder, young_s, remove=True))


def pass_over_dead_ports(folder: Path = SHARED_MEMORY) -> tuple[int, ...]:
    """Keep this process off the ports of killed ones, as long as it lives. Call before `rclpy.init`.

    Their locks are taken, so that Fast DDS finds these ports in use and opens the next ones. Where somebody
    else took them first, or another user's they are, Fast DDS finds the same.

    Returns:
        The numbers of the ports that were taken by this call.
    """
    taken = []
    for file in sorted(folder.glob("fast*_port*_el")):
        found = _PORT_LOCK.fullmatch(file.name)
        if not found or int(found[1]) < FIRST_PORT:
            continue
        with ExitStack() as held:
            if _locked(file, held):
                _passed_over.append(held.pop_all())
                taken.append(int(found[1]))
    return tuple(taken)


def _each(folder: Path, young_s: float, remove: bool) -> Iterator[Leftover]:
    locks: dict[str, list[Path]] = {}
    for path in sorted(folder.iterdir()) if folder.is_dir() else ():
        if found := _LOCK.fullmatch(path.name):
            locks.setdefault(found[1], []).append(path)
    written_to = _mapped(folder) if locks else frozenset()
    for name, files in locks.items():
        if "_port" in name and name in written_to:  # its number must not be used again, see above
            continue
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


def _mapped(folder: Path) -> frozenset[str]:
    """Names in a folder that some process maps into its memory; of others' processes root alone knows."""
    names: set[str] = set()
    for maps in Path("/proc").glob("[0-9]*/maps"):
        try:
            text = maps.read_text()
        except OSError:  # ended, or another user's
            continue
        names.update(re.findall(rf"{re.escape(str(folder))}/(\w+)", text))
    return frozenset(names)


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
