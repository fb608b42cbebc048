"""A thread can be led through the eye in this world, by one who is told how it hangs."""

from __future__ import annotations

from functools import partial

import numpy as np
import pybullet
import pytest

from samrl_core.cell.robots.arm_model import ArmModel, Payload
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.robots.inverse_kinematics import solve_ik
from samrl_core.cell.tasks.needle_threading.task import NEEDLE, NeedleThreading
from samrl_core.cell.tasks.needle_threading.thread import crossing_distance
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.world.evaluation import true_values
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.cell.world.settings import NOISELESS
from tests.cell.world.scripted_expert import DOWN, move_joints
from tests.cell.world.sub_goal_expert import Pace, episodes, follow

CELL = cell_named()
TASK = NeedleThreading()
TRUE = partial(true_values, TASK)


def test_expert_threads_the_needle() -> None:
    """Within the actions allowed, and so that it hangs in the eye after half a second of rest."""
    for episode in episodes(TASK, CELL, TRUE, range(2), Pace()):
        assert episode.success and episode.done
        assert episode.actions < 60
        assert episode.error < TASK.eye_radius


def test_the_thread_starts_at_rest_where_it_was_drawn() -> None:
    """Its springs hold its weight from the first instant on."""
    world = PyBulletWorld(TASK, CELL, NOISELESS)
    for seed in range(3):
        world.reset(seed)
        drawn = TASK.sample_start(np.random.default_rng(seed).spawn(3)[0]).chain_angles
        np.testing.assert_allclose(TRUE(world.truth()), drawn, atol=2e-3)
        for _ in range(150):
            world.advance()
        np.testing.assert_allclose(TRUE(world.truth()), drawn, atol=2e-3)
    world.close()


@pytest.mark.thorough
def test_a_pulled_thread_swings_back_and_comes_to_rest() -> None:
    """Put straight, against its springs, it swings and settles where it had hung, within 0.3 mm after 2 s."""
    world = PyBulletWorld(TASK, CELL, NOISELESS)
    world.reset(3)
    hung = world.truth().chain_points[-1] - world.truth().tip_position
    arm = world._arms["tool_arm"].body
    for joint in world._chain._joints:
        pybullet.resetJointState(arm, joint, 0.0, 0.0, physicsClientId=world._client)
    places = []
    for _ in range(2000):
        world.advance()
        truth = world.truth()
        places.append(truth.chain_points[-1] - truth.tip_position)
    away = np.linalg.norm(np.array(places) - hung, axis=1)
    assert away[0] > 0.008
    assert away.max() < 1.2 * away[0]  # no energy is added
    assert (np.array(places)[:, 0] - hung[0]).min() < -0.0002  # it swings through: not overdamped
    assert away[-200:].max() < 3e-4
    world.close()


def test_the_eye_holds_the_thread() -> None:
    """Threaded and pulled 20 mm aside, the thread bends at the eye instead of passing through its wall."""

    world = PyBulletWorld(TASK, CELL, NOISELESS)
    assert follow(world, TASK, CELL, TRUE, 0).success
    tool = TASK.scene(CELL).tool
    load = Payload(tool.mass, tool.center_of_mass, tool.inertia)
    model = ArmModel(CELL.tool_arm, CELL.tool_base_in_world, load)
    q = world.read_arm("tool_arm").position
    tip = (model.flange_in_base(q) @ tool.tip_in_flange).position
    target = Pose.from_rotation(tip + [0.02, 0.0, 0.0], DOWN) @ tool.tip_in_flange.inverse()
    move_joints(world, model, q, solve_ik(model, target, q), 500)
    truth = world.truth()
    below = truth.chain_points[truth.chain_points[:, 2] < TASK.eye_z - 0.002]
    assert truth.peak_contact_force > 0.01
    assert len(below) and (np.hypot(*(below[:, :2] - TASK.eye[:2]).T) < 0.03).all()

    assert crossing_distance(truth.chain_points, truth.body_position[NEEDLE]) < TASK.eye_radius
    world.close()


@pytest.mark.slow
def test_expert_threads_it_from_everywhere() -> None:
    """20 threads."""
    found = episodes(TASK, CELL, TRUE, range(20), Pace())
    assert sum(episode.success for episode in found) >= 18


@pytest.mark.slow
def test_a_careless_expert_still_threads_it() -> None:
    """A quarter of each action is noise."""
    found = episodes(TASK, CELL, TRUE, range(8), Pace(noise=0.25))
    assert sum(episode.success for episode in found) >= 6
