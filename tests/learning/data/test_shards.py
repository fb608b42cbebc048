"""Data sets on disk: whole shards, resumed where one is missing, foreign and damaged ones refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.common.errors import InputError
from samrl_core.learning.data.shards import MANIFEST, DataInfo, ShardFolder

INFO = DataInfo("states", "peg_insertion", cell_named().intrinsics, 3, 10, 4, {"explore": {"slots": (1, 2)}})


def arrays(shard: int) -> dict[str, np.ndarray]:
    rng, size = INFO.rng(shard), INFO.size(shard)
    return {"x": rng.normal(size=(size, 3)), "name": np.array([f"goal_{k}" for k in range(size)])}


def filled(folder: Path) -> ShardFolder:
    data = ShardFolder(folder, INFO)
    for shard in data.missing():
        data.write(shard, arrays(shard))
    return data


def test_what_is_written_is_read(tmp_path: Path) -> None:
    filled(tmp_path)
    data = ShardFolder.open(tmp_path, "states", "peg_insertion")
    assert data.info.header() == INFO.header() and not data.missing()
    assert [data.info.size(k) for k in range(data.info.shards)] == [4, 4, 2]
    for shard, found in enumerate(data.read_all()):
        expected = arrays(shard)
        assert set(found) == set(expected)
        for name, array in expected.items():
            np.testing.assert_array_equal(found[name], array)


def test_a_resumed_data_set_has_the_same_bytes(tmp_path: Path) -> None:
    """Interrupted after the second shard's file but before it was listed, and with a half-written third."""
    filled(tmp_path / "whole")
    first = ShardFolder(tmp_path / "resumed", INFO)
    first.write(0, arrays(0))
    (tmp_path / "resumed" / "states-00001.npz").write_bytes(b"not listed yet")
    again = ShardFolder(tmp_path / "resumed", INFO)
    assert again.missing() == (1, 2)
    for shard in reversed(again.missing()):  # as processes finish in any order
        again.write(shard, arrays(shard))
    names = sorted(p.name for p in (tmp_path / "whole").iterdir())
    assert names == sorted(p.name for p in (tmp_path / "resumed").iterdir()) and len(names) == 4
    for name in names:
        assert (tmp_path / "whole" / name).read_bytes() == (tmp_path / "resumed" / name).read_bytes()


@pytest.mark.parametrize(
    "other",
    [
        replace(INFO, seed=4),
        replace(INFO, task="needle_threading"),
        replace(INFO, settings={"explore": {}}),
        replace(INFO, intrinsics=replace(INFO.intrinsics, fx=1.01 * INFO.intrinsics.fx)),
    ],
    ids=["seed", "task", "settings", "camera"],
)
def test_another_data_set_is_refused(tmp_path: Path, other: DataInfo) -> None:
    filled(tmp_path)
    with pytest.raises(InputError, match="another data set"):
        ShardFolder(tmp_path, other)


def test_damage_is_refused(tmp_path: Path) -> None:
    data = filled(tmp_path)
    file = tmp_path / "states-00001.npz"
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(bytes(content))
    with pytest.raises(InputError, match="not the file that the manifest lists"):
        data.read(1)
    file.unlink()
    with pytest.raises(InputError, match="missing"):
        data.read(1)


def test_an_unfinished_data_set_is_not_read(tmp_path: Path) -> None:
    data = ShardFolder(tmp_path, INFO)
    data.write(1, arrays(1))
    with pytest.raises(InputError, match="lacks 2 of 3 shards"):
        list(data.read_all())
    with pytest.raises(InputError, match="not made yet"):
        data.read(0)


def test_wrong_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no data set"):
        ShardFolder.open(tmp_path, "states", "peg_insertion")
    filled(tmp_path)
    with pytest.raises(InputError, match="not images of task"):
        ShardFolder.open(tmp_path, "images", "peg_insertion")
    path = tmp_path / MANIFEST
    manifest = json.loads(path.read_text())
    for broken in ("{", "[]", json.dumps({"seed": 3}), json.dumps({**manifest, "format": 99})):
        path.write_text(broken)
        with pytest.raises(InputError, match="manifest"):
            ShardFolder(tmp_path, INFO)


def test_arrays_must_fit_their_shard(tmp_path: Path) -> None:
    data = ShardFolder(tmp_path, INFO)
    with pytest.raises(InputError, match="must hold 2 samples"):
        data.write(2, arrays(0))
    with pytest.raises(InputError, match="does not exist"):
        data.write(3, arrays(0))
    with pytest.raises(InputError, match="at least 1"):
        replace(INFO, count=0)
    with pytest.raises(InputError, match="JSON"):
        replace(INFO, settings={"x": object()})
