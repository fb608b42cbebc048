"""The control law by hand, and its response in PyBullet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.robots.robot import ROLES
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.observation import ArmCommand
from samrl_core.cell.world.pybullet.impedance import impedance_effort
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.cell.world.settings import NOISELESS

CELL = cell_named()
TASK = task_named("peg_insertion")


def test_law_by_hand() -> None:
    """K 2, D 3, error 0.5 and -0.1, gravity 4, feed-forward 5: 1 - 0.3 + 4 + 5."""
    spec = CELL.tool_arm
    controller = replace(spec.controller, stiffness=np.full(7, 2.0), damping=np.full(7, 3.0))
    command = ArmCommand(0, np.full(7, 0.5), np.zeros(7), np.full(7, 99.0), np.full(7, 5.0))
    effort = impedance_effort(controller, spec.limits, command, np.zeros(7), np.full(7, 0.1), np.full(7, 4.0))
    np.testing.assert_allclose(effort, 9.7)


def test_law_is_clipped_on_both_sides() -> None:
    """At the effort limits, whatever is asked."""
    spec = CELL.tool_arm
    zero = np.zeros(7)
    for sign in (1.0, -1.0):
        command = ArmCommand(0, zero, zero, zero, np.full(7, sign * 1e4))
        effort = impedance_effort(spec.controller, spec.limits, command, zero, zero, zero)
        np.testing.assert_array_equal(effort, sign * spec.limits.effort)


@pytest.mark.parametrize("role", ROLES)
def test_holding_does_not_drift(role: str) -> None:
    """1 s without a command, sensor noise on: gravity is compensated, noise is not amplified."""
    world = PyBulletWorld(TASK, CELL)
    start = TASK.start_joints(CELL)[role]
    worst = 0.0
    for _ in range(1000):
        world.advance()
        worst = max(worst, float(np.abs(world.read_arm(role).position - start).max()))
    assert worst < 1e-3
    world.close()


@pytest.mark.parametrize("role", ROLES)
def test_effort_at_rest_is_gravity(role: str) -> None:
    """Within the sensor's noise, averaged."""
    world = PyBulletWorld(TASK, CELL)
    start = TASK.start_joints(CELL)[role]
    efforts = []
    for _ in range(400):
        world.advance()
        efforts.append(world.read_arm(role).effort)
    gravity = world._models[role].gravity(start)
    assert np.abs(gravity).max() > 5.0
    np.testing.assert_allclose(np.mean(efforts[100:], axis=0), gravity, atol=0.03)
    assert np.std(np.array(efforts[100:]), axis=0).max() < 0.15
    world.close()


@pytest.mark.parametrize("role", ROLES)
@pytest.mark.parametrize("joint", range(7))
def test_step_response(role: str, joint: int) -> None:
    """A step of 0.02 rad of one joint: arrives, overshoots by less than half, disturbs no other for long."""
    world = PyBulletWorld(TASK, CELL, NOISELESS)
    start = world.read_arm(role).position
    goal = start.copy()
    goal[joint] += 0.02
    zero = np.zeros(7)
    world.command(role, ArmCommand(0, goal, zero, zero, zero))
    track = []
    for _ in range(1500):
        world.advance()
        track.append(world.read_arm(role).position)
    moved = np.array(track) - start
    assert moved[:, joint].max() < 0.03
    np.testing.assert_allclose(track[-1], goal, atol=1e-3)
    world.close()
