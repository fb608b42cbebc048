"""A round's episodes and labels are kept part by part: what was made is not made again, and is the same."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import torch

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.common.array_file import read_arrays, write_arrays
from samrl_core.common.errors import InputError
from samrl_core.learning.sim import episodes as module
from samrl_core.learning.sim.episodes import EpisodeGroup, run_cached_groups
from samrl_core.learning.sim.prepare import label_all
from samrl_core.learning.states.frames import SceneFrames
from samrl_core.model.model import Model
from samrl_core.policy.networks.networks import SimActor

TASK = "peg_insertion"
NAMES = ("values", "tip_in_base", "success")
GROUPS = [EpisodeGroup(3, ("round", k), 2, True, 0.0, noisy=True, max_actions=2) for k in range(3)]


@cache
def actor() -> SimActor:
    return SimActor(task_named(TASK).action_limit, torch.Generator().manual_seed(0))


def run(folder: Path, stop_at: int = -1) -> tuple[list[dict[str, np.ndarray]], list[int]]:
    told: list[int] = []

    def tell(row: dict[str, float]) -> None:
        told.append(int(row["groups"]))
        if told[-1] == stop_at:
            raise InterruptedError

    try:
        return run_cached_groups(TASK, actor(), GROUPS, NAMES, folder, "cpu", 1, tell), told
    except InterruptedError:
        return [], told


def same(first: Path, second: Path) -> None:
    names = sorted(p.name for p in first.iterdir())
    assert names == sorted(p.name for p in second.iterdir()) and names
    for name in names:
        assert (first / name).read_bytes() == (second / name).read_bytes(), name


def test_groups_that_have_ended_are_not_run_again(tmp_path: Path) -> None:
    whole, told = run(tmp_path / "whole")
    assert told == [0, 1, 2, 3] and len(whole) == 3
    assert run(tmp_path / "parts", stop_at=2)[1] == [0, 1, 2]
    found, told = run(tmp_path / "parts")
    assert told == [2, 3]
    same(tmp_path / "whole", tmp_path / "parts")
    for one, other in zip(whole, found, strict=True):
        assert set(one) == set(NAMES) and len(one["success"]) == 2 < len(one["values"])
        for name in NAMES:
            np.testing.assert_array_equal(one[name], other[name])


def test_finished_groups_need_no_renderer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = {"values": np.zeros((4, 2)), "tip_in_base": np.zeros((4, 3)), "success": np.array([True, False])}
    for k in range(3):
        write_arrays(tmp_path / f"{k:04d}.npz", rows)
    monkeypatch.setattr(module, "run_groups", lambda task, actor, groups, *rest: iter(groups and [1 / 0]))
    assert len(run(tmp_path)[0]) == 3
    write_arrays(tmp_path / "0001.npz", {**rows, "more": np.zeros(1)})
    with pytest.raises(InputError, match=r"0001\.npz holds the arrays .*more.* must hold"):
        run(tmp_path)
    write_arrays(tmp_path / "0001.npz", {**rows, "values": np.full((4, 2), np.nan)})
    with pytest.raises(InputError, match=r"0001\.npz: values is not finite"):
        run(tmp_path)
    (tmp_path / "0001.npz").write_bytes((tmp_path / "0002.npz").read_bytes()[:-30])
    with pytest.raises(InputError, match="remove it to make it anew"):
        run(tmp_path)


def test_labels_are_kept_part_by_part(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    model = Model(task_named(TASK), cell_named())
    values = np.array([model.task.start_values(rng) for _ in range(5)])
    tips = np.tile(SceneFrames(model).start_tip, (5, 1)) - rng.uniform(0.0, 0.05, (5, 1)) * [0.0, 0.0, 1.0]

    def stop(done: int, wanted: int) -> None:
        if done == 4:
            raise InterruptedError

    with pytest.raises(InterruptedError):
        label_all(TASK, values, tips, tmp_path / "parts", 1, stop, shard_size=2)
    told: list[int] = []
    found = label_all(
        TASK, values, tips, tmp_path / "parts", 1, lambda done, wanted: told.append(done), shard_size=2
    )
    assert told == [4, 5]
    whole = label_all(TASK, values, tips, tmp_path / "whole", 1, shard_size=2)
    same(tmp_path / "whole", tmp_path / "parts")
    for one, other in zip(whole, found, strict=True):
        np.testing.assert_array_equal(one, other)
    action, left = found
    assert left.all() and 0.0 < np.linalg.norm(action, axis=1).min()
    assert np.linalg.norm(action, axis=1).max() <= model.task.action_limit + 1e-9
    with pytest.raises(InputError, match="another data set"):
        label_all(TASK, values[::-1], tips, tmp_path / "parts", 1, shard_size=2)


def test_arrays_come_back_as_they_were(tmp_path: Path) -> None:
    arrays = {"a": np.arange(6.0).reshape(2, 3), "b": np.array(["x", "yz"]), "c": np.array([True])}
    write_arrays(tmp_path / "deep" / "file.npz", arrays)
    found = read_arrays(tmp_path / "deep" / "file.npz", tuple(arrays))
    for name, array in arrays.items():
        np.testing.assert_array_equal(found[name], array)
        assert found[name].dtype == array.dtype
    with pytest.raises(InputError, match="cannot read"):
        read_arrays(tmp_path / "none.npz", ("a",))
