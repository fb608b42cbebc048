"""Straight lines, with inverse kinematics stood in for and with the real one."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.control.cartesian import straight_line
from samrl_core.cell.control.smoother import JointSmoother
from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.robots.inverse_kinematics import solve_ik
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError, LimitError

START = Pose(np.array([0.5, 0.0, 0.3]), np.array([1.0, 0.0, 0.0, 0.0]))
SEED = np.zeros(7)


def joints_are_coordinates(pose: Pose, seed: np.ndarray) -> np.ndarray:
    return np.concatenate([pose.position - START.position, seed[3:]])


def test_waypoints_lie_on_the_line_and_end_at_its_end() -> None:
    d = np.array([0.03, -0.04, 0.0])
    points = np.array(straight_line(joints_are_coordinates, START, d, SEED, 0.011))
    assert len(points) == 5
    np.testing.assert_allclose(points[:, :3], np.outer(np.arange(1, 6) / 5, d), atol=1e-12)


def test_each_waypoint_is_solved_from_the_one_before_with_fixed_orientation() -> None:
    seeds = []

    def solve(pose: Pose, seed: np.ndarray) -> np.ndarray:
        np.testing.assert_array_equal(pose.quat_xyzw, START.quat_xyzw)
        seeds.append(seed)
        return seed + 0.01

    points = straight_line(solve, START, np.array([0.0, 0.0, 0.02]), SEED, 0.005)
    np.testing.assert_array_equal(seeds[0], SEED)
    for seed, point in zip(seeds[1:], points, strict=False):
        np.testing.assert_array_equal(seed, point)


def test_zero_displacement_is_one_waypoint() -> None:
    points = straight_line(joints_are_coordinates, START, np.zeros(3), SEED, 0.005)
    assert len(points) == 1


@pytest.mark.parametrize("step", [0.3, np.nan])
def test_jump_of_the_solution_is_refused(step: float) -> None:
    with pytest.raises(LimitError, match="waypoint 1 of 2.*direction"):
        straight_line(lambda pose, seed: seed + step, START, np.array([0.01, 0, 0]), SEED, 0.005)


@pytest.mark.parametrize(
    ("displacement", "spacing"),
    [([np.nan, 0, 0], 0.005), ([0.0, 0.0], 0.005), ([0.01, 0, 0], 0.0), ([0.01, 0, 0], np.nan)],
)
def test_bad_numbers_are_refused(displacement: list[float], spacing: float) -> None:
    with pytest.raises(InputError):
        straight_line(joints_are_coordinates, START, np.array(displacement), SEED, spacing)


def test_smoothed_line_of_the_tool_arm_bows_little_and_ends_where_asked() -> None:
    cell, rng = cell_named(), np.random.default_rng(0)
    spec = cell.tool_arm
    arm = ArmModel(spec, cell.tool_base_in_world, None)
    start = arm.flange_in_base(spec.home)
    smoother = JointSmoother(spec.limits, 0.004, 0.4, 0.4, 0.2)
    for _ in range(4):
        way = rng.standard_normal(3)
        way /= np.linalg.norm(way)
        smoother.reset(spec.home)
        smoother.set_waypoints(
            straight_line(lambda p, q: solve_ik(arm, p, q), start, 0.018 * way, spec.home, 0.005)
        )
        travelled = []
        while not smoother.done:
            travelled.append(arm.flange_in_base(smoother.step()[0]).position - start.position)
            assert len(travelled) < 500
        off_line = np.array(travelled) - np.outer(np.array(travelled) @ way, way)
        assert np.linalg.norm(off_line, axis=1).max() < 1.2e-3
        np.testing.assert_allclose(travelled[-1], 0.018 * way, atol=1e-4)
