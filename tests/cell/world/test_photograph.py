"""The photograph of the bench: it shows what stands there, the same again for the same bench."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.instance.cell_instance import instance_named
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.world.pybullet.photograph import BenchState, PhotographSettings, photograph_bench

CELL, TASK = cell_named(), task_named("peg_insertion_hard")
SMALL = PhotographSettings(size=(180, 120), focal=190.0, finer=1, link_faces=300, hand_faces=300)


@pytest.fixture(scope="module")
def state() -> BenchState:
    values = np.array([p.nominal for p in TASK.parameters()])
    return BenchState(TASK.start_joints(CELL), TASK.body_poses(values), TASK.chain_angles(values))


def photographed(state: BenchState, instance: str = "typical:1") -> np.ndarray:
    return photograph_bench(TASK, CELL, instance_named(instance, CELL), state, SMALL).astype(float)


def test_a_block_that_was_moved_shows_elsewhere_and_all_else_stays(state: BenchState) -> None:
    here = photographed(state)
    np.testing.assert_array_equal(here, photographed(state))
    (name, pose), *_ = state.body_in_world.items()
    moved = {name: Pose(pose.position + [0.0, -0.12, 0.0], pose.quat_xyzw)}
    changed = np.abs(photographed(replace(state, body_in_world=moved)) - here).max(axis=-1) > 60.0
    assert 0.01 < changed.mean() < 0.12, changed.mean()


def test_a_bench_is_no_diagram(state: BenchState) -> None:
    image = photographed(state)
    assert image.shape == (120, 180, 3)
    # No tenth of the pixels has one colour, the light falls off to the corners, another cell looks different.
    _, counts = np.unique((image // 4).reshape(-1, 3), axis=0, return_counts=True)
    assert counts.max() < 0.1 * counts.sum()
    assert image[:20].mean() < 0.8 * image[40:100, 60:120].mean()
    assert np.abs(photographed(state, "typical:4") - image).mean() > 8.0
