"""Round trips, refusals and smoothness of the inverse kinematics; dynamics identities of the model."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.robots.cells import robots
from samrl_core.cell.robots.inverse_kinematics import solve_ik
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError, ReachError


@pytest.fixture(params=robots())
def arm(request: pytest.FixtureRequest) -> ArmModel:
    return ArmModel(robots()[request.param], Pose.identity(), None)


def _assert_at(arm: ArmModel, q: np.ndarray, target: Pose) -> None:
    there = arm.flange_in_base(q)
    np.testing.assert_allclose(there.position, target.position, atol=1e-5)
    assert there.angle_to(target) < 2e-5
    assert (q >= arm.spec.limits.lower + 0.0499).all()
    assert (q <= arm.spec.limits.upper - 0.0499).all()


def test_round_trip(arm: ArmModel) -> None:
    limits, rng = arm.spec.limits, np.random.default_rng(3)
    for q in rng.uniform(limits.lower + 0.1, limits.upper - 0.1, (60, 7)):
        target = arm.flange_in_base(q)
        _assert_at(arm, solve_ik(arm, target, q + rng.normal(0.0, 0.2, 7)), target)


def test_home_is_a_fixed_point(arm: ArmModel) -> None:
    home = arm.spec.home
    np.testing.assert_allclose(solve_ik(arm, arm.flange_in_base(home), home), home, atol=1e-9)


def test_spec_and_model_give_the_same(arm: ArmModel) -> None:
    target = arm.flange_in_base(arm.spec.home + 0.1)
    np.testing.assert_array_equal(
        solve_ik(arm, target, arm.spec.home), solve_ik(arm.spec, target, arm.spec.home)
    )


def test_straight_line_is_smooth(arm: ArmModel) -> None:
    """Millimetre steps of the flange are small steps of the joints: no jump between branches."""
    q, pose = arm.spec.home, arm.flange_in_base(arm.spec.home)
    for _ in range(40):
        pose = Pose(pose.position + np.array([0.0, 0.001, -0.001]), pose.quat_xyzw)
        after = solve_ik(arm, pose, q)
        assert np.abs(after - q).max() < 0.03
        q = after


def test_far_pose_is_refused_with_what_is_left(arm: ArmModel) -> None:
    far = Pose(np.array([2.0, 0.0, 0.5]), np.array([0.0, 0.0, 0.0, 1.0]))
    with pytest.raises(ReachError, match="mm"):
        solve_ik(arm, far, arm.spec.home)


def test_bad_arguments_are_refused(arm: ArmModel) -> None:
    target = arm.flange_in_base(arm.spec.home)
    with pytest.raises(InputError, match="seed"):
        solve_ik(arm, target, np.zeros(6))
    with pytest.raises(InputError, match="q0"):
        solve_ik(arm, target, arm.spec.home, q0=np.full(7, np.nan))
    with pytest.raises(InputError, match="margin"):
        solve_ik(arm, target, arm.spec.home, margin_rad=3.2)


def test_jacobian_equals_finite_differences(arm: ArmModel) -> None:
    q, h = arm.spec.home + 0.1, 1e-6
    jacobian = arm.jacobian(q)
    for k in range(7):
        d = np.zeros(7)
        d[k] = h
        column = (arm.flange_in_base(q + d).position - arm.flange_in_base(q - d).position) / (2 * h)
        np.testing.assert_allclose(jacobian[:3, k], column, atol=1e-8)


def test_dynamics_fit_together(arm: ArmModel) -> None:
    rng = np.random.default_rng(5)
    q, dq, ddq = arm.spec.home, rng.normal(size=7), rng.normal(size=7)
    tau = arm.inverse_dynamics(q, dq, ddq)
    parts = arm.mass_matrix(q) @ ddq + arm.inverse_dynamics(q, dq, np.zeros(7))
    np.testing.assert_allclose(tau, parts, atol=1e-9)
    still = arm.inverse_dynamics(q, np.zeros(7), np.zeros(7))
    np.testing.assert_allclose(arm.gravity(q), still, atol=1e-9)
    np.testing.assert_allclose(arm.forward_dynamics(q, dq, tau), ddq, atol=1e-8)
    np.testing.assert_allclose(arm.effort_without_gravity(q, dq, ddq), tau - arm.gravity(q), atol=1e-12)
