"""A chain's mass matrix, weight and springs, against a second engine, energy and a closed form."""

from __future__ import annotations

import numpy as np
import pybullet
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks.chain import holding_torque, link_poses
from samrl_core.cell.tasks.needle_threading.task import NeedleThreading
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import ChainLink
from samrl_core.cell.world.pybullet.chain_springs import ChainSprings, ChainState
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.cell.world.settings import NOISELESS

CELL = cell_named()
TASK = NeedleThreading()
CHAIN = TASK.scene(CELL).tool.chain
GRAVITY = np.array([0.0, 0.0, -9.81])
TIP = Pose.from_rpy(np.array([0.5, 0.1, 0.3]), (3.0, 0.1, 0.4))


def state_of(chain: tuple[ChainLink, ...], angle: np.ndarray, speed: np.ndarray) -> ChainState:
    """By the tasks' kinematics."""
    poses = link_poses(chain, TIP, angle)
    position, rotation = np.array([p.position for p in poses]), np.array([p.rotation for p in poses])
    return ChainState(TIP.rotation, position, rotation, angle, speed)


def test_mass_matrix_is_that_of_the_simulator() -> None:
    """PyBullet's own composite-rigid-body algorithm, at drawn angles."""
    world = PyBulletWorld(TASK, CELL, NOISELESS)
    arm, chain = world._arms["tool_arm"], world._chain
    state = chain.state(world._tip_in_world())
    joints = [
        i
        for i in range(pybullet.getNumJoints(arm.body, physicsClientId=world._client))
        if pybullet.getJointInfo(arm.body, i, physicsClientId=world._client)[2] != pybullet.JOINT_FIXED
    ]
    states = pybullet.getJointStates(arm.body, joints, physicsClientId=world._client)
    whole = np.array(
        pybullet.calculateMassMatrix(arm.body, [s[0] for s in states], physicsClientId=world._client)
    )
    ours, _ = ChainSprings(CHAIN, 1e-3, GRAVITY).mass_matrix(state)
    np.testing.assert_allclose(ours, whole[7:, 7:], rtol=1e-5, atol=1e-12)
    world.close()


def test_weight_is_the_slope_of_the_energy() -> None:
    """By central differences; the torque that holds is its opposite."""
    angle = np.random.default_rng(0).uniform(-0.5, 0.5, 20)

    def energy(angle: np.ndarray) -> float:
        poses = link_poses(CHAIN, TIP, angle)
        return sum(
            -link.mass * float(GRAVITY @ pose.apply(link.center_of_mass))
            for link, pose in zip(CHAIN, poses, strict=True)
        )

    h = 1e-5
    slope = np.array([(energy(angle + h * e) - energy(angle - h * e)) / (2 * h) for e in np.eye(20)])
    holding = holding_torque(CHAIN, TIP, angle, GRAVITY)
    np.testing.assert_allclose(holding, slope, rtol=1e-6, atol=1e-11)
    _, weight = ChainSprings(CHAIN, 1e-3, GRAVITY).mass_matrix(state_of(CHAIN, angle, np.zeros(20)))
    np.testing.assert_allclose(weight, -holding, rtol=1e-9, atol=1e-14)


def test_torque_at_equilibrium_is_the_springs() -> None:
    """Where springs and weight balance, the torque is k (rest - q), whatever the period."""
    angle = np.random.default_rng(1).uniform(-0.2, 0.2, 20)
    holding = holding_torque(CHAIN, TIP, angle, GRAVITY)
    for period in (1e-4, 1e-3, 1e-2):
        springs = ChainSprings(CHAIN, period, GRAVITY)
        rest = angle + holding / springs.stiffness
        torque = springs.torque(state_of(CHAIN, angle, np.zeros(20)), rest)
        np.testing.assert_allclose(torque, holding, rtol=1e-6, atol=1e-10)


def test_torque_for_a_short_period_is_that_of_spring_and_damper() -> None:
    """k (rest - q) - d dq, in the limit."""
    rng = np.random.default_rng(2)
    angle, speed, rest = rng.uniform(-0.2, 0.2, 20), rng.uniform(-1, 1, 20), np.zeros(20)
    springs = ChainSprings(CHAIN, 1e-9, GRAVITY)
    expected = springs.stiffness * (rest - angle) - springs.damping * speed
    torque = springs.torque(state_of(CHAIN, angle, speed), rest)
    np.testing.assert_allclose(torque, expected, rtol=1e-2, atol=1e-4)


@pytest.mark.parametrize("period", [1e-3, 5e-3])
def test_the_law_loses_energy_at_any_period(period: float) -> None:
    """Stepped with its own mass matrix and without weight, energy never grows, from any start."""
    rng = np.random.default_rng(3)
    springs = ChainSprings(CHAIN, period, np.zeros(3))
    angle, speed = rng.uniform(-0.3, 0.3, 20), rng.uniform(-5, 5, 20)
    mass, _ = springs.mass_matrix(state_of(CHAIN, np.zeros(20), speed))  # linearised: held fixed

    def energy() -> float:
        return float(0.5 * speed @ mass @ speed + 0.5 * springs.stiffness @ angle**2)

    first = before = energy()
    for _ in range(200):
        # The straight chain's geometry with these angles: the linearised chain.
        torque = springs.torque(ChainState(*_straight(), angle, speed), np.zeros(20))
        speed = speed + period * np.linalg.solve(mass, torque)
        angle = angle + period * speed
        after = energy()
        assert after <= before * (1 + 1e-9)
        before = after
    assert before < 0.05 * first


def _straight() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    state = state_of(CHAIN, np.zeros(20), np.zeros(20))
    return state.tip_rotation, state.position, state.rotation
