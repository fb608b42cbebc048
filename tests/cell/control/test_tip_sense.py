"""Forces from torques, and compliance, against what defines them."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.control.tip_sense import TipSense
from samrl_core.cell.robots.arm_model import ArmModel, Payload
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.observation import ArmReading

CELL, TASK = cell_named(), task_named("peg_insertion_hard")
TOOL = TASK.scene(CELL).tool
ARM = ArmModel(CELL.tool_arm, CELL.tool_base_in_world, Payload(TOOL.mass, TOOL.center_of_mass, TOOL.inertia))
Q = TASK.start_joints(CELL)["tool_arm"]


def tip_at(q: np.ndarray) -> np.ndarray:
    return ARM.flange_in_base(q).apply(TOOL.tip_in_flange.position)


def jacobian(q: np.ndarray) -> np.ndarray:
    """Of the tip by central differences, (3, J)."""
    steps = 1e-6 * np.eye(len(q))
    return np.stack([(tip_at(q + s) - tip_at(q - s)) / 2e-6 for s in steps], axis=1)


def reading(effort: np.ndarray) -> ArmReading:
    return ArmReading(0, Q, np.zeros(7), effort)


def test_a_force_at_the_tip_is_read_off_the_torques() -> None:
    force = np.array([3.0, -2.0, -12.0])
    found = TipSense(CELL, TOOL).read(reading(ARM.gravity(Q) + jacobian(Q).T @ force))
    np.testing.assert_allclose(found.force, force, atol=1e-4)
    np.testing.assert_allclose(found.tip, tip_at(Q), atol=1e-12)


def test_compliance_is_how_far_the_controller_gives_way() -> None:
    """Joint by joint: a force turns each by its torque over its stiffness."""
    force = np.array([0.5, 0.3, -0.4])
    turned = jacobian(Q).T @ force / CELL.tool_arm.controller.stiffness
    found = TipSense(CELL, TOOL).read(reading(ARM.gravity(Q)))
    np.testing.assert_allclose(found.compliance @ force, tip_at(Q + turned) - tip_at(Q), atol=2e-5)
    assert np.linalg.norm(found.compliance @ force) > 5e-4
    before, after = ARM.flange_in_base(Q).rotation, ARM.flange_in_base(Q + turned).rotation
    turn = (after @ before.T)[[2, 0, 1], [1, 2, 0]]
    np.testing.assert_allclose(found.turning @ force, turn, atol=2e-5)
    assert np.linalg.norm(turn) > 5e-4
