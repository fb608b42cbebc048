"""States that Real2Sim found: kept whole, refused when foreign, and begun in by a training."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from samrl_core.cell.calibration.cell_correction import CellCorrection, CorrectionCovariance
from samrl_core.cell.tasks import task_named
from samrl_core.common.errors import InputError
from samrl_core.learning.sim.prepare import prepare_states
from samrl_core.learning.sim.sample_states import StateSource
from samrl_core.learning.sim.train import CONFIG, train
from samrl_core.learning.states.explore import ExploreSettings
from samrl_core.learning.states.states import StateSamples
from samrl_core.learning.states.visited import VisitedStates, load_visited, save_visited
from samrl_core.policy.networks.weights import sha256_of
from tests.learning.sim.test_train import SMALL

TASK = task_named("peg_insertion")
HOLE = np.array([0.5437, -0.0421])  # no stage of a usual episode begins at the tips below
TIPS = np.array([[0.47, 0.06, 0.09], [0.53, 0.05, 0.12]])


def visited(task: str = "peg_insertion", count: int = 2) -> VisitedStates:
    size = len(task_named(task).parameters())
    values = np.tile(HOLE, (count, 1)) if size == 2 else np.zeros((count, size))
    return VisitedStates(
        task,
        values,
        np.tile(1e-6 * np.eye(size), (count, 1, 1)),
        TIPS[np.arange(count) % 2],
        np.zeros(count, dtype=np.int64),
        np.arange(count),
    )


@pytest.mark.thorough
def test_states_near_what_was_visited_are_learnt_from(tmp_path: Path) -> None:
    """About a quarter of the episodes begin there; none of a training without them comes near."""
    given = visited().starts(TASK)
    settings = ExploreSettings(slots=2, longest=4)
    with_them = prepare_states(TASK.name, 80, tmp_path / "with", 3, 1, StateSource(settings, given))
    without = prepare_states(TASK.name, 80, tmp_path / "without", 3, 1, StateSource(settings))

    def near(states: StateSamples) -> int:
        same_hole = np.linalg.norm(states.values - HOLE, axis=1) < 0.003
        distance = np.linalg.norm(states.tip_in_base[:, None] - TIPS, axis=2).min(axis=1)
        return int((same_hole & (distance < 0.015)).sum())

    assert near(with_them) >= 8
    assert near(without) == 0


def test_a_file_gives_back_what_was_saved(tmp_path: Path) -> None:
    save_visited(tmp_path / "v.npz", visited(count=3))
    found = load_visited(tmp_path / "v.npz", TASK.name)
    for name, array in visited(count=3).arrays().items():
        np.testing.assert_array_equal(found.arrays()[name], array)
    assert found.task == TASK.name


def test_foreign_and_damaged_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "v.npz"
    with pytest.raises(InputError, match="no file of visited states"):
        load_visited(path, TASK.name)
    save_visited(path, visited("needle_threading"))
    with pytest.raises(InputError, match="needle_threading"):
        load_visited(path, TASK.name)
    save_visited(path, visited())
    whole = path.read_bytes()
    for content in (whole[: len(whole) // 2], b"", b"PK not a zip", whole.replace(b"PK", b"XX")):
        path.write_bytes(content)
        with pytest.raises(InputError, match="no whole file"):
            load_visited(path, TASK.name)
    np.savez(path, values=np.zeros((1, 2)))
    with pytest.raises(InputError, match="no whole file"):
        load_visited(path, TASK.name)
    header = {"format": 1, "task": TASK.name, "names": [p.name for p in TASK.parameters()]}
    arrays = visited().arrays()
    for change, words in (({"format": 9}, "format 9"), ({"names": ["a"]}, "'a'"), ({"names": 3}, "no whole")):
        np.savez(path, samrl_visited_states=json.dumps(header | change), **arrays)
        with pytest.raises(InputError, match=words):
            load_visited(path, TASK.name)
    broken = arrays | {"values": np.full((2, 2), np.inf)}
    np.savez(path, samrl_visited_states=json.dumps(header), **broken)
    with pytest.raises(InputError, match="not finite"):
        load_visited(path, TASK.name)
    for k in range(0, len(whole), 7):  # no damaged byte is taken for data, whatever it hits
        path.write_bytes(whole[:k] + bytes([whole[k] ^ 0x5A]) + whole[k + 1 :])
        try:
            found = load_visited(path, TASK.name)
        except InputError:
            continue
        for name, array in arrays.items():
            np.testing.assert_array_equal(found.arrays()[name], array)


def test_what_does_not_fit_is_refused() -> None:
    good = visited()
    for change, words in (
        ({"values": np.zeros((2, 3))}, "shape"),
        ({"tip_in_base": np.full((2, 3), np.nan)}, "finite"),
        ({"step": np.zeros(2)}, "step"),
        ({"episode": np.zeros(3, dtype=np.int64)}, "shape"),
    ):
        with pytest.raises(InputError, match=words):
            replace(good, **change)
    with pytest.raises(InputError, match="no task"):
        VisitedStates.joined([])
    with pytest.raises(InputError, match="cannot be joined"):
        VisitedStates.joined([good, visited("needle_threading")])


def test_joined_files_keep_their_episodes_apart() -> None:
    part = replace(visited(count=3), episode=np.array([4, 4, 9]))
    found = VisitedStates.joined([part, part])
    np.testing.assert_array_equal(found.episode, [0, 0, 1, 2, 2, 3])


def test_only_what_leaves_something_to_do_is_begun_in() -> None:
    done = np.append(HOLE, 0.015)  # the peg's end, deep in the hole
    outside = replace(visited(), values=np.array([[0.9, 0.0], [0.5, 0.0]]))
    assert len(outside.starts(TASK).values) == 1
    finished = replace(visited(), tip_in_base=np.array([done, [0.5, 0.0, 0.1]]))
    np.testing.assert_array_equal(finished.starts(TASK).tip_in_base, [[0.5, 0.0, 0.1]])
    with pytest.raises(InputError, match="none of 1 visited"):
        finished.rows(slice(0, 1)).starts(TASK)


def test_a_training_records_what_it_was_given(tmp_path: Path) -> None:
    """By content, not by name; with other states it is another training."""
    file = tmp_path / "v.npz"
    save_visited(file, visited())

    class Begun(Exception):
        pass

    def stop(stage: str, row: dict[str, float]) -> None:
        raise Begun

    with pytest.raises(Begun):
        train(TASK.name, tmp_path / "t", SMALL, stop, visited=[file])
    recorded = json.loads((tmp_path / "t" / CONFIG).read_text())
    assert recorded["visited"] == [sha256_of(file)]
    moved = file.rename(tmp_path / "elsewhere.npz")
    with pytest.raises(Begun):
        train(TASK.name, tmp_path / "t", SMALL, stop, visited=[moved])
    with pytest.raises(InputError, match="visited"):
        train(TASK.name, tmp_path / "t", SMALL, stop)
    save_visited(moved, visited("needle_threading"))
    with pytest.raises(InputError, match="needle_threading"):
        train(TASK.name, tmp_path / "u", SMALL, stop, visited=[moved])
    assert not (tmp_path / "u" / CONFIG).exists()


def test_a_training_for_a_corrected_cell_goes_on_with_the_same_correction(tmp_path: Path) -> None:
    uniform = replace(SMALL, randomisation="uniform")
    known = CorrectionCovariance(("depth_scale",), np.array([[1e-6]]))
    corrected = CellCorrection(numbers={"depth_scale": 0.01}, covariance=known)

    def stop(stage: str, row: dict[str, float]) -> None:
        raise KeyboardInterrupt

    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            train(TASK.name, tmp_path, uniform, stop, correction=corrected)
    with pytest.raises(InputError, match="correction"):
        train(TASK.name, tmp_path, uniform, stop)
