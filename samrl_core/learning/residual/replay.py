"""Steps on the real cell, kept in one file: a ring that outlives its process, killed or not.

One process writes; others may read the same file meanwhile. A slot is void while it is written, and holds a
checksum: a kill costs at most the step that was being written, in a full ring the oldest as well.
A step holds observation and action; how the episode ended is added to its last step (eq. 16). What follows
a step is the next one of its episode, so that no image is stored twice.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import tempfile
import zlib
from dataclasses import asdict, dataclass
from enum import IntEnum
from pathlib import Path
from typing import IO, Literal

import numpy as np

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError
from samrl_core.common.files import room_for, write_whole
from samrl_core.learning.images.packed_images import packed_depth, poses_as_rows

MAGIC = b"samrl-replay-2\n"
HEADER_BYTES = 4096  # a page, so that slots begin on one
_VOID = -1  # number of a slot that is being written
_END_CODE = 0x11111111  # times an end is what is stored: it is written after the checksum, and guards itself


class End(IntEnum):
    """How an episode ended at a step."""

    OPEN = 0  # it goes on, or its end is not known
    SUCCESS = 1  # detected: reward 1
    FAILURE = 2  # actions used up: reward 0, and nothing follows
    CUT = 3  # stopped by a fault: what the action would have led to is not known


@dataclass(frozen=True, eq=False)
class ReplayStep:
    """One action on the cell and the observation before it."""

    episode: int  # counted within the replay, see `Replay.next_episode`
    step: int  # within the episode, from 0
    color: np.ndarray  # (H, W, 3) uint8
    depth: np.ndarray  # (H, W) [m], NaN where unmeasured
    camera_in_world: Pose  # optical frame, from measured joints and calibration
    tip_in_base: np.ndarray  # (3,) from measured joints, at the image [m]
    nominal: np.ndarray  # (3,) action from the model, a_sim [m]
    residual: np.ndarray  # (3,) what was added to it [m]
    executed: np.ndarray  # (3,) measured displacement of the tip [m]


@dataclass(frozen=True)
class ReplayInfo:
    """What a replay holds; another task, camera or capacity is another replay."""

    task: str
    intrinsics: Intrinsics
    capacity: int  # steps; at 128x128 px 82 kB each

    def slot_type(self) -> np.dtype:
        """Layout of a slot; the checksum covers `body` and the number."""
        k = self.intrinsics
        vectors = [(name, "<f8", (3,)) for name in ("tip", "nominal", "residual", "executed")]
        body = np.dtype(
            [
                ("episode", "<i8"),
                ("step", "<i8"),
                ("camera", "<f8", (7,)),
                *vectors,
                ("color", "u1", (k.height, k.width, 3)),
                ("depth", "<u2", (k.height, k.width)),
            ]
        )
        return np.dtype([("number", "<i8"), ("crc", "<u4"), ("end", "<u4"), ("body", body)])


class Replay:
    """Steps by number, counted from 1 and never again; the last `capacity` of them are there.

    Open it by `write` or `read`.
    """

    def __init__(self, path: Path, info: ReplayInfo, slots: np.memmap, lock: IO[bytes] | None) -> None:
        self.path, self.info = path, info
        self._slots = slots
        self._lock = lock  # the open file of the writer; unlocked when the process ends
        self.last = 0  # newest number, 0 for none
        self._check_all()

    @staticmethod
    def write(path: Path, info: ReplayInfo) -> Replay:
        """Open for the one process that adds steps; the file is made when there is none.

        Raises:
            InputError: the file is corrupt, another's (task, camera, capacity), or being written by another
                process.
        """
        if not path.exists() and not path.is_symlink():
            _make(path, info)
        _check_file(path)
        lock = path.open("r+b")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            lock.close()
            raise InputError(f"{path} is being written by another process; give each cell its own") from error
        return Replay(path, info, _slots(path, info, "r+"), lock)

    @staticmethod
    def read(path: Path, info: ReplayInfo) -> Replay:
        """Open to follow what another process adds, see `refresh`.

        Raises:
            InputError: there is no such file, it is corrupt, or another's.
        """
        if not path.is_file():
            raise InputError(f"no replay at {path}; its writer makes it")
        return Replay(path, info, _slots(path, info, "r"), None)

    def __len__(self) -> int:
        return int(self.present().size)

    def next_episode(self) -> int:
        """An episode's number that no step has yet."""
        present = self.present()
        return int(self._slots["body"]["episode"][self._slot(present)].max()) + 1 if present.size else 0

    def append(self, step: ReplayStep) -> int:
        """Add a step whose episode goes on as far as is known; returns its number.

        Raises:
            InputError: images of another size, a vector that is not three finite numbers, or no room for it.
        """
        body = self._packed(step)
        number = self.last + 1
        self._take_room(number)
        slot = self._slots[self._slot(number)]
        slot["number"] = _VOID
        slot["body"] = body
        slot["end"] = _END_CODE * End.OPEN
        slot["crc"] = _checksum(number, body)
        slot["number"] = number
        self.last = number
        return number

    def _take_room(self, number: int) -> None:
        """The file is sparse: on a full disk a slot without room would end this process by SIGBUS."""
        size = self._slots.itemsize
        if self._lock is not None:
            with room_for(self.path):
                os.posix_fallocate(self._lock.fileno(), HEADER_BYTES + int(self._slot(number)) * size, size)

    def end_episode(self, number: int, end: End) -> None:
        """Say how the episode of step `number`, its last, ended.

        Raises:
            InputError: no such step is there.
        """
        if not 1 <= number <= self.last or self._slots["number"][self._slot(number)] != number:
            raise InputError(f"step {number} is not in the replay, whose newest is {self.last}")
        self._slots["end"][self._slot(number)] = _END_CODE * int(end)

    def drop_after(self, number: int) -> None:
        """Forget the steps that came after step `number`, 0 for all: they are to be done again.

        Raises:
            InputError: older steps were written over since, so that what was before cannot be had back.
        """
        if self.last > self.info.capacity and number < self.last:
            raise InputError(
                f"{self.path} has written over its first {self.last - self.info.capacity} steps and cannot "
                f"go back to step {number}; begin anew with a larger capacity"
            )
        for later in range(self.last, number, -1):  # the newest first: a kill leaves no gap
            self._slots["number"][self._slot(later)] = 0
        self.last = min(self.last, number)

    def flush(self) -> None:
        """Onto the disk, for a power cut; a killed process needs none."""
        self._slots.flush()

    def refresh(self) -> int:
        """Take in what the writer added; returns how many steps are new."""
        before = self.last
        numbers = np.array(self._slots["number"])
        for number in np.sort(numbers[numbers > before]):
            body = np.array(self._slots["body"][self._slot(number)])
            if self._slots["crc"][self._slot(number)] != _checksum(int(number), body):
                break  # overwritten while it was read
            self.last = int(number)
        return self.last - before

    def present(self) -> np.ndarray:
        """Numbers of the steps that are there, in order."""
        first = max(1, self.last - self.info.capacity + 1)
        numbers = np.arange(first, self.last + 1)
        return numbers[self._slots["number"][self._slot(numbers)] == numbers]

    def outline(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Numbers, episodes, steps and ends (N,) of what is there."""
        numbers = self.present()
        index, body = self._slot(numbers), self._slots["body"]
        ends = np.asarray(self._slots["end"][index]) // _END_CODE
        return numbers, np.asarray(body["episode"][index]), np.asarray(body["step"][index]), ends

    def bodies(self, numbers: np.ndarray) -> np.ndarray:
        """Copies of steps (N,) as structured rows, see `ReplayInfo.slot_type`.

        Raises:
            InputError: one is not there any more; choose again after `refresh`.
        """
        rows = np.asarray(self._slots["body"][self._slot(numbers)])  # indexing by an array copies
        if not np.array_equal(self._slots["number"][self._slot(numbers)], numbers):
            raise InputError("a step was overwritten while it was read; the replay is too small for its use")
        return rows

    def close(self) -> None:
        """Let others write."""
        lock, self._lock = self._lock, None
        if lock is not None:
            self.flush()
            lock.close()

    def _slot(self, number):
        return (number - 1) % self.info.capacity

    def _packed(self, step: ReplayStep) -> np.ndarray:
        k = self.info.intrinsics
        body = np.zeros((), dtype=self._slots.dtype["body"])
        if step.color.shape != (k.height, k.width, 3) or step.depth.shape != (k.height, k.width):
            raise InputError(
                f"images are {step.color.shape} and {step.depth.shape}, the replay's {k.width}x{k.height} px"
            )
        for name, value in (
            ("tip", step.tip_in_base),
            ("nominal", step.nominal),
            ("residual", step.residual),
            ("executed", step.executed),
        ):
            vector = np.asarray(value, dtype=np.float64)
            if vector.shape != (3,) or not np.isfinite(vector).all():
                raise InputError(f"{name} is {value}, must be three finite numbers [m]")
            body[name] = vector
        body["episode"], body["step"] = step.episode, step.step
        body["camera"] = poses_as_rows([step.camera_in_world])[0]
        body["color"], body["depth"] = step.color, packed_depth(step.depth)
        return body

    def _check_all(self) -> None:
        """Every slot holds what belongs there; the one that a killed writer was at may be torn."""
        torn = []
        for index in range(self.info.capacity):
            number = int(self._slots["number"][index])
            if number == 0:
                continue
            slot = self._slots[index]
            end, remainder = divmod(int(slot["end"]), _END_CODE)
            whole = number > 0 and self._slot(number) == index and end <= max(End) and remainder == 0
            if whole and slot["crc"] == _checksum(number, slot["body"]):
                self.last = max(self.last, number)
            else:
                torn.append(index)
        gaps = min(self.last, self.info.capacity - len(torn)) - len(self)
        if torn not in ([], [self._slot(self.last + 1)]) or gaps > 0:
            where = torn[0] if torn else "of a lost step"
            raise InputError(
                f"{self.path} is corrupt: slot {where} does not hold what was written; move the file away to "
                f"begin anew"
            )


def _checksum(number: int, body: np.ndarray) -> int:
    return zlib.crc32(body.tobytes(), number & 0xFFFFFFFF)


def _header(info: ReplayInfo) -> bytes:
    about = {**asdict(info), "slot_bytes": info.slot_type().itemsize}
    text = MAGIC + json.dumps(about, sort_keys=True).encode()
    return text.ljust(HEADER_BYTES, b"\n")


def _make(path: Path, info: ReplayInfo) -> None:
    """The empty file. Two processes may find none at once: the first one's stays, and both open that."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{path.name}.", dir=path.parent) as folder:
        half = Path(folder) / "new"
        write_whole(half, _header(info))
        with half.open("r+b") as file:
            file.truncate(HEADER_BYTES + info.capacity * info.slot_type().itemsize)  # sparse
        with contextlib.suppress(FileExistsError):
            os.link(half, path)  # as `replace`, but never over another one's


def _slots(path: Path, info: ReplayInfo, mode: Literal["r", "r+"]) -> np.memmap:
    _check_file(path)
    with path.open("rb") as file:
        head = file.read(HEADER_BYTES)
    kind, expected = info.slot_type(), _header(info)
    if not head.startswith(MAGIC):
        raise InputError(f"{path} is no replay of this version; give another path")
    if head != expected:
        raise InputError(
            f"{path} holds {head[len(MAGIC) :].strip().decode(errors='replace')}, wanted is "
            f"{expected[len(MAGIC) :].strip().decode()}; a replay belongs to one task, camera and capacity"
        )
    size = HEADER_BYTES + info.capacity * kind.itemsize
    if path.stat().st_size != size:
        raise InputError(
            f"{path} has {path.stat().st_size} bytes, must have {size}: it is cut short or grown; move it "
            f"away to begin anew"
        )
    return np.memmap(path, dtype=kind, mode=mode, offset=HEADER_BYTES, shape=(info.capacity,))


def _check_file(path: Path) -> None:
    """It can be opened: it is no folder, and no pipe that would be waited for."""
    if not path.is_file():
        raise InputError(f"{path} is no file; give another path")
