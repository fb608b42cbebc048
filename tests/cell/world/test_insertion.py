"""The task can be done in this world, under torque control, by one who is told where the hole is."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.robots.inverse_kinematics import solve_ik
from samrl_core.cell.tasks.peg_insertion.task import PegInsertion
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.cell.world.settings import NOISELESS
from tests.cell.world.scripted_expert import Episode, insert, move_joints, tool_model

CELL = cell_named()


def episodes(clearance: float, seeds: range, noise: float = 0.0) -> list[Episode]:
    """One per seed, an action every 0.1 s."""
    task = PegInsertion(clearance=clearance)
    world, model = PyBulletWorld(task, CELL), tool_model(task, CELL)
    found = [insert(world, task, model, seed, noise=noise, period_s=0.1) for seed in seeds]
    world.close()
    return found


def test_expert_inserts() -> None:
    """Within the actions allowed, gently."""
    for episode in episodes(0.002, range(3)):
        assert episode.success and episode.done
        assert episode.actions < 30
        assert episode.peak_force < 30.0
        assert episode.error < 0.001


def test_missing_the_hole_fails() -> None:
    """Told a place 8 mm off, the expert ends on top of the block, and both judgements say so."""
    task = PegInsertion(max_actions=25)
    world, model = PyBulletWorld(task, CELL), tool_model(task, CELL)
    episode = insert(world, task, model, 0, period_s=0.1, misled=np.array([0.008, 0.0]))
    assert not episode.success and not episode.done
    assert episode.peak_force > 1.0
    assert episode.error > 0.015
    world.close()


def test_the_hole_holds_the_peg() -> None:
    """Pushed 6 mm sideways inside a hole of 1 mm clearance, the tip moves by about the clearance."""
    task = PegInsertion(clearance=0.001)
    world, model = PyBulletWorld(task, CELL, NOISELESS), tool_model(task, CELL)
    assert insert(world, task, model, 0, period_s=0.1).success
    before = world.truth()
    q = world.read_arm("tool_arm").position
    flange = model.flange_in_base(q)
    end = solve_ik(model, Pose(flange.position + np.array([0.006, 0.0, 0.0]), flange.quat_xyzw), q)
    move_joints(world, model, q, end, 300)
    after = world.truth()
    moved = after.tip_position - before.tip_position
    assert 0.0007 < moved[0] < 0.0016  # the arm gives way by turning, so a little more than the clearance
    assert abs(moved[1]) < 0.0005
    assert after.peak_contact_force > 2.0
    world.close()


@pytest.mark.slow
@pytest.mark.parametrize(("clearance", "least"), [(0.002, 20), (0.001, 19)])
def test_expert_inserts_from_everywhere(clearance: float, least: int) -> None:
    """20 holes."""
    found = episodes(clearance, range(20))
    assert sum(episode.success for episode in found) >= least
    assert max(episode.peak_force for episode in found) < 30.0


@pytest.mark.slow
def test_a_careless_expert_fails_sometimes() -> None:
    """Half of each action is noise: the task is not won by trying."""
    found = episodes(0.001, range(8), noise=0.5)
    assert sum(episode.success for episode in found) <= 5
