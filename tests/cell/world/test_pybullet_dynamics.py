"""PyBullet's arms against Pinocchio's: same masses, no hidden damping, same kinematics."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pybullet
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.robots.inverse_kinematics import solve_ik
from samrl_core.cell.robots.robot import ROLES
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.camera import Camera
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.cell.world.settings import NOISELESS
from samrl_core.common.errors import InputError
from tests.cell.world.scripted_expert import DOWN, move_joints

CELL = cell_named()
TASK = task_named("peg_insertion")


@pytest.fixture
def world() -> Iterator[PyBulletWorld]:
    """Without noise."""
    made = PyBulletWorld(TASK, CELL, NOISELESS)
    yield made
    made.close()


@pytest.mark.parametrize("role", ROLES)
def test_mass_matrix_agrees(world: PyBulletWorld, role: str) -> None:
    """Payload and rotated inertias included."""
    arm, model = world._arms[role], world._models[role]
    q = TASK.start_joints(CELL)[role]
    found = np.array(pybullet.calculateMassMatrix(arm.body, q.tolist(), physicsClientId=arm._client))
    np.testing.assert_allclose(found, model.mass_matrix(q), atol=1e-6)


@pytest.mark.parametrize("role", ROLES)
def test_free_swing(world: PyBulletWorld, role: str) -> None:
    """0.12 s of falling without torque: the path of the equations of motion, and no energy lost."""
    arm, model = world._arms[role], world._models[role]
    start = TASK.start_joints(CELL)[role]
    q, dq, period = start.copy(), np.zeros(7), 1e-3
    arm.place(q)
    work = 0.0
    for _ in range(120):
        before = arm.state()
        arm.push(np.zeros(7))
        pybullet.stepSimulation(physicsClientId=arm._client)
        after = arm.state()
        work += float(model.gravity(0.5 * (before[0] + after[0])) @ (after[0] - before[0]))
        dq = dq + period * model.forward_dynamics(q, dq, np.zeros(7))  # semi-implicit Euler, as Bullet
        q = q + period * dq
    found = arm.state()
    assert np.abs(dq).max() > 0.5, "the arm must really fall"
    np.testing.assert_allclose(found[0], q, atol=1e-4)
    np.testing.assert_allclose(found[1], dq, atol=2e-3)
    kinetic = 0.5 * float(found[1] @ model.mass_matrix(found[0]) @ found[1])
    assert kinetic + work == pytest.approx(0.0, abs=0.02 * kinetic)


@pytest.mark.parametrize("role", ROLES)
def test_kinematics_agree(world: PyBulletWorld, role: str) -> None:
    """Flange in world, at random joints."""
    arm, model = world._arms[role], world._models[role]
    rng = np.random.default_rng(0)
    limits = CELL.arm(role).limits
    for _ in range(10):
        q = rng.uniform(limits.lower, limits.upper)
        arm.place(q)
        found, expected = arm.flange_in_world(), model.flange_in_world(q)
        np.testing.assert_allclose(found.position, expected.position, atol=1e-6)
        assert found.angle_to(expected) < 1e-5


def test_camera_sees_the_block_where_it_is(world: PyBulletWorld) -> None:
    """Top of the block, unprojected through measured joints and nominal calibration, is at its height."""
    for seed in range(3):
        world.reset(seed)
        frame = world.read_camera()
        flange = world._models["camera_arm"].flange_in_world(world.read_arm("camera_arm").position)
        points = Camera(CELL.intrinsics, flange @ CELL.camera_in_flange).unproject(frame.depth)
        block = points[frame.mask == 1]
        assert len(block) > 300
        top = block[block[:, 2] > 0.039]
        assert len(top) > 200
        np.testing.assert_allclose(top[:, 2], 0.04, atol=1e-3)
        hole = world.truth().body_position["hole_board"]
        np.testing.assert_allclose(0.5 * (top[:, :2].min(0) + top[:, :2].max(0)), hole[:2], atol=0.004)


def test_pressing_on_the_block_is_a_contact(world: PyBulletWorld) -> None:
    """Tip driven 2 mm into the top: force felt and stamped, seen by the torque sensors, gone on reset."""
    model = world._models["tool_arm"]
    hole = world.truth().body_position["hole_board"]
    q = world.read_arm("tool_arm").position
    for height, steps in ((0.045, 800), (0.038, 400), (0.038, 300)):
        tip = np.array([hole[0] + 0.03, hole[1], height])
        flange = Pose.from_rotation(tip + np.array([0.0, 0.0, 0.1634]), DOWN)
        end = solve_ik(model, flange, q)
        move_joints(world, model, q, end, steps)
        q = end
        if height == 0.045:
            assert world.truth().first_contact_ns == -1
    truth = world.truth()
    assert 800e6 < truth.first_contact_ns < 1200e6
    assert 0.0390 < truth.tip_position[2] < 0.0402
    reading = world.read_arm("tool_arm")
    felt = np.linalg.pinv(model.jacobian(reading.position).T) @ (
        model.gravity(reading.position) - reading.effort
    )
    assert 2.0 < felt[2] < 30.0  # the block pushes up
    assert felt[2] <= truth.peak_contact_force * 1.05
    world.reset(0)
    assert world.truth().first_contact_ns == -1 and world.truth().peak_contact_force == 0.0


def test_rotor_inertia_is_refused() -> None:
    """PyBullet cannot hold it, so it must not be dropped in silence."""
    arm = replace(CELL.tool_arm, armature=np.full(7, 0.1))
    with pytest.raises(InputError, match="rotor inertia"):
        PyBulletWorld(TASK, replace(CELL, tool_arm=arm))
