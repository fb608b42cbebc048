"""The tip of a tool: its acceleration against its own motion, and its effective mass against a force."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.robots.arm_model import ArmModel, Payload
from samrl_core.cell.robots.panda.spec import PANDA
from samrl_core.cell.robots.tip_dynamics import TipDynamics
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError

TIP = Pose(np.array([0.03, -0.01, 0.2]), np.array([0.0, 0.0, 0.0, 1.0]))
DIRECTION = np.array([0.6, 0.0, -0.8])
Q = PANDA.home + np.array([0.3, -0.2, 0.4, 0.1, -0.3, 0.2, 0.5])


@pytest.fixture(scope="module")
def arm() -> ArmModel:
    load = Payload(0.8, np.array([0.0, 0.01, 0.05]), np.diag([0.002, 0.003, 0.002]))
    return ArmModel(PANDA, Pose.identity(), load)


def test_acceleration_is_that_of_the_moving_tip(arm: ArmModel) -> None:
    """Second difference of the tip's place over a step of the arm's own dynamics."""
    tip = TipDynamics(arm, TIP, DIRECTION)
    rng = np.random.default_rng(0)
    for _ in range(5):
        dq, h = rng.uniform(-1, 1, 7), 1e-4
        tau = arm.gravity(Q) + rng.uniform(-5, 5, 7)
        ddq = arm.forward_dynamics(Q, dq, tau)
        ahead, behind = Q + h * dq + 0.5 * h**2 * ddq, Q - h * dq + 0.5 * h**2 * ddq
        places = [float(tip.position(q) @ DIRECTION) for q in (behind, Q, ahead)]
        measured = (places[2] - 2 * places[1] + places[0]) / h**2
        assert tip.free_acceleration(Q, dq, tau) == pytest.approx(measured, abs=1e-4)


def test_a_force_at_the_tip_meets_the_effective_mass(arm: ArmModel) -> None:
    """Whatever the drives do, 3 N along the line change the acceleration by 3 N / m."""
    tip = TipDynamics(arm, TIP, DIRECTION)
    dq, tau = 0.3 * np.ones(7), arm.gravity(Q) + np.arange(7.0)
    change = tip.free_acceleration(Q, dq, tau + 3.0 * tip.gradient(Q)) - tip.free_acceleration(Q, dq, tau)
    assert change == pytest.approx(3.0 / tip.effective_mass(Q), rel=1e-9)
    assert 0.1 < tip.effective_mass(Q) < 20.0


def test_a_direction_that_is_none_is_refused(arm: ArmModel) -> None:
    with pytest.raises(InputError, match="length 1"):
        TipDynamics(arm, TIP, np.array([1.0, 1.0, 0.0]))
