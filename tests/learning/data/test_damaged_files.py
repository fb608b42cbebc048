"""Files of a training after damage, and files that are none: refused by name, never unpickled, never a crash.

A file that is damaged where nothing is written, e.g. in the time stamp of a zip, is read as what it was.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import pickle
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import safetensors.torch
import torch

from samrl_core.cell.robots.cells import cell_named
from samrl_core.common.array_file import read_arrays, write_arrays
from samrl_core.common.errors import InputError
from samrl_core.learning.data.checkpoint import load_checkpoint, save_checkpoint
from samrl_core.learning.data.shards import MANIFEST, DataInfo, ShardFolder
from samrl_core.learning.residual.replay import Replay, ReplayInfo
from samrl_core.learning.residual.training import Announcement, announced
from samrl_core.policy.networks.networks import SimActor
from samrl_core.policy.networks.weights import WeightsInfo, load_weights, save_weights
from tests.learning.small_cell import SMALL, random_step

TASK = "peg_insertion"
ARRAYS = {"x": np.arange(12.0).reshape(4, 3), "name": np.array(["a", "bc", "d", "e"])}
ROUNDS = 150  # damaged copies of each file


@dataclass(frozen=True)
class Kind:
    """A kind of file: its name in a folder, how it is written and read; what was read can be compared."""

    name: str
    write: Callable[[Path], object]
    read: Callable[[Path], Any]


def _write_weights(path: Path) -> None:
    info = WeightsInfo("sim_actor", TASK, cell_named().intrinsics, 0.01, 4, {"error_mm": 0.5}, "abc")
    save_weights(path, SimActor(0.01, torch.Generator().manual_seed(1)), info)


def _read_weights(path: Path) -> Any:
    network, info = load_weights(path, "sim_actor", TASK, cell_named())
    return plain(network.state_dict()), asdict(info)


def _write_checkpoint(path: Path) -> None:
    adam = {
        "adam.0.step": torch.tensor(3.0),
        "empty": torch.zeros(0, 2),
        "flags": torch.tensor([True, False]),
    }
    save_checkpoint(path, "toy", {"a": torch.arange(300.0), **adam}, {"step": 3, "rows": [{"loss": 0.1}]})


def _read_checkpoint(path: Path) -> Any:
    tensors, about = load_checkpoint(path, "toy")
    return plain(tensors), about


SHARDS = DataInfo("states", TASK, cell_named().intrinsics, 3, 4, 4, {"explore": {"slots": [1, 2]}})
SHARD = {"shard": 0, "file": "states-00000.npz", "count": 4, "sha256": "x"}
REPLAY = ReplayInfo(TASK, SMALL.intrinsics, 4)


def _write_shard(path: Path) -> None:
    ShardFolder(path.parent, SHARDS).write(0, ARRAYS)


def _read_shard(path: Path) -> Any:
    ShardFolder(path.parent, SHARDS)  # as it is resumed
    return plain(ShardFolder.open(path.parent, "states", TASK).read(0))


def _write_replay(path: Path) -> None:
    replay = Replay.write(path, REPLAY)
    for k in range(3):
        replay.append(random_step(np.random.default_rng(k), 0, k))
    replay.close()


def _read_replay(path: Path) -> Any:
    replay = Replay.read(path, REPLAY)
    numbers, episodes, steps, ends = replay.outline()
    if len(numbers) == 2:  # the newest is as one that a killed writer left
        return "lost its newest"
    return (
        numbers.tolist(),
        episodes.tolist(),
        steps.tolist(),
        ends.tolist(),
        replay.bodies(numbers).tobytes(),
    )


def _write_announcement(path: Path) -> None:
    (path.parent / "residual_v000001.safetensors").write_bytes(b"weights")
    path.write_text(json.dumps(asdict(Announcement(TASK, 1, "residual_v000001.safetensors", "0" * 64))))


def plain(arrays: dict[str, Any]) -> dict[str, Any]:
    return {name: np.asarray(value).tolist() for name, value in arrays.items()}


KINDS = [
    Kind("w.safetensors", _write_weights, _read_weights),
    Kind("checkpoint.safetensors", _write_checkpoint, _read_checkpoint),
    Kind("labelled.npz", lambda p: write_arrays(p, ARRAYS), lambda p: plain(read_arrays(p, tuple(ARRAYS)))),
    Kind("states-00000.npz", _write_shard, _read_shard),
    Kind(MANIFEST, _write_shard, _read_shard),
    Kind("replay.bin", _write_replay, _read_replay),
]
every_kind = pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)


def damaged(content: bytes, rng: np.random.Generator, k: int) -> bytes:
    """A copy that is cut short, has bits flipped, a block overwritten, moved or doubled, or is grown."""
    data = bytearray(content)
    # Half of the damage is where a file says what it is: that is little of a long file.
    at = int(rng.integers(min(len(data), 600) if k % 2 else len(data)))
    size = int(rng.integers(1, 40))
    match (k // 2) % 6:
        case 0:
            return bytes(data[:at])
        case 1:
            data[at] ^= 1 << int(rng.integers(8))
        case 2:
            data[at : at + size] = rng.bytes(len(data[at : at + size]))
        case 3:
            del data[at : at + size]
        case 4:
            data[at:at] = data[at : at + size]
        case _:
            data += rng.bytes(size)
    return bytes(data)


@every_kind
def test_a_damaged_file_is_refused_or_read_as_it_was(tmp_path: Path, kind: Kind) -> None:
    path = tmp_path / kind.name
    kind.write(path)
    whole, content = kind.read(path), path.read_bytes()
    rng = np.random.default_rng(11)
    refused = 0
    for k in range(ROUNDS):
        path.write_bytes(damaged(content, rng, k))
        try:
            found = kind.read(path)
        except InputError as error:
            refused += 1
            assert str(tmp_path) in str(error), "the message names the file"
        else:
            assert found in (whole, "lost its newest"), f"round {k}"
    assert refused > 0.6 * ROUNDS
    path.write_bytes(content)
    assert kind.read(path) == whole


@every_kind
def test_what_is_no_file_is_refused(tmp_path: Path, kind: Kind) -> None:
    path = tmp_path / "folder" / kind.name
    path.parent.mkdir()
    kind.write(path)
    (tmp_path / "elsewhere").mkdir()

    def directory() -> None:
        path.mkdir()

    def link_to_one() -> None:
        path.symlink_to(tmp_path / "elsewhere")

    def loop() -> None:
        path.symlink_to(path)

    def nowhere() -> None:
        path.symlink_to(tmp_path / "missing")

    def fifo() -> None:
        os.mkfifo(path)  # opening it would wait for ever

    for make in (directory, link_to_one, loop, nowhere, fifo):
        path.rmdir() if path.is_dir() and not path.is_symlink() else path.unlink()
        make()
        with pytest.raises(InputError):
            kind.read(path)


class Canary:
    """Unpickling it makes a file."""

    def __init__(self, marker: Path) -> None:
        self.marker = marker

    def __reduce__(self) -> tuple[Callable[..., object], tuple[str, str]]:
        return open, (str(self.marker), "w")


@every_kind
def test_no_pickle_is_opened(tmp_path: Path, kind: Kind) -> None:
    marker, path = tmp_path / "marker", tmp_path / kind.name
    kind.write(path)
    canary = Canary(marker)
    pickle.loads(pickle.dumps(canary)).close()
    assert marker.exists()  # the canary works
    marker.unlink()
    objects = np.empty(4, dtype=object)
    objects[0] = canary
    ways: list[Callable[[], object]] = [
        lambda: path.write_bytes(pickle.dumps(canary)),
        lambda: torch.save({"a": canary}, path),
        lambda: path.write_bytes(_objects(objects)),
        lambda: path.write_bytes(b"\x80\x04"),
    ]
    for write in ways:
        write()
        if kind.name.startswith("states-"):  # a forger would list it, too
            _list_anew(path)
        with pytest.raises(InputError):
            kind.read(path)
        assert not marker.exists()


def _objects(objects: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, x=objects, name=ARRAYS["name"])  # pickles them
    return buffer.getvalue()


def _list_anew(path: Path) -> None:
    manifest = json.loads((path.parent / MANIFEST).read_text())
    manifest["shards"][0]["sha256"] = hashlib.sha256(path.read_bytes()).hexdigest()
    (path.parent / MANIFEST).write_text(json.dumps(manifest))


@pytest.mark.parametrize(
    "length", [0, 1, 2**31, 2**63 - 1, 2**64 - 1], ids=["none", "one", "2 GiB", "most", "all bits"]
)
def test_a_header_of_any_stated_length_is_refused(tmp_path: Path, length: int) -> None:
    for kind in KINDS[:2]:
        path = tmp_path / kind.name
        kind.write(path)
        path.write_bytes(length.to_bytes(8, "little") + path.read_bytes()[8:])
        with pytest.raises(InputError, match="no whole safetensors file"):
            kind.read(path)


@pytest.mark.parametrize("text", ["[" * 100_000, "3", "null", '["a"]', '{"format": 1}', "{", "\ud800"])
def test_a_description_that_is_none_is_refused(tmp_path: Path, text: str) -> None:
    for kind, entry in zip(KINDS[:2], ("samrl", "samrl_checkpoint"), strict=True):
        path = tmp_path / kind.name
        encoded = text.encode("utf-8", "replace").decode()
        path.write_bytes(safetensors.torch.save({"a": torch.zeros(2)}, {entry: encoded}))
        with pytest.raises(InputError):
            kind.read(path)


@pytest.mark.parametrize(
    "change",
    [
        {"shards": 3},
        {"shards": [3]},
        {"shards": [{}]},
        {"shards": [{**SHARD, "file": 4}]},
        {"shards": [{**SHARD, "shard": 7}]},
        {"intrinsics": {"width": 128}},
        {"intrinsics": None},
        {"count": "4"},
        {"count": 4.5},
        {"shard_size": None},
        {"kind": ["states"]},
        {"seed": "a"},
        {"shards": [SHARD, SHARD]},
        {"shards": [{**SHARD, "file": "../states-00000.npz"}]},
    ],
)
def test_a_manifest_that_says_something_else_is_refused(tmp_path: Path, change: dict[str, Any]) -> None:
    _write_shard(tmp_path / "states-00000.npz")
    path = tmp_path / MANIFEST
    path.write_text(json.dumps({**json.loads(path.read_text()), **change}))
    with pytest.raises(InputError, match=str(tmp_path)):
        ShardFolder.open(tmp_path, "states", TASK).read(0)
    with pytest.raises(InputError, match=str(tmp_path)):
        _read_shard(tmp_path / "states-00000.npz")


@pytest.mark.parametrize(
    "change",
    [{"version": "1"}, {"version": -1}, {"version": True}, {"file": 3}, {"file": "../x"}, {"sha256": None}],
)
def test_an_announcement_that_says_something_else_is_refused(tmp_path: Path, change: dict[str, Any]) -> None:
    path = tmp_path / "announced.json"
    _write_announcement(path)
    assert announced(tmp_path, TASK).version == 1
    path.write_text(json.dumps({**json.loads(path.read_text()), **change}))
    with pytest.raises(InputError, match=r"announced\.json"):
        announced(tmp_path, TASK)


def test_every_flipped_bit_of_a_kept_step_is_found(tmp_path: Path) -> None:
    """Its end as well, which is written after the rest: a failure must not become a success."""
    path = tmp_path / "replay.bin"
    _write_replay(path)
    content = path.read_bytes()
    start = len(content) - REPLAY.capacity * REPLAY.slot_type().itemsize
    for at in (*range(16), 40, 200, 900):
        for bit in range(8):
            data = bytearray(content)
            data[start + at] ^= 1 << bit  # of the first of three steps
            path.write_bytes(bytes(data))
            with pytest.raises(InputError, match="corrupt"):
                Replay.read(path, REPLAY)
    with pytest.raises(InputError, match="belongs to one task"):
        Replay.read(_restored(path, content), replace(REPLAY, task="needle_threading"))


def _restored(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path
