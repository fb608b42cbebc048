"""Tip and force of a tool from one reading of its arm's joints."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from samrl_core.cell.robots.arm_model import ArmModel, Payload
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.types.observation import ArmReading
from samrl_core.cell.types.scene import Tool


@dataclass(frozen=True, eq=False)
class TipReading:
    """At rest, in the tool arm's base axes."""

    tip: np.ndarray  # (3,) by the encoders [m]
    force: np.ndarray  # (3,) of the arm on its surroundings, with the sensors' and the load's offset [N]
    compliance: np.ndarray  # (3, 3) displacement of the tip by a force, as the controller is told [m/N]
    # (3, 3) turn of the tool by a force at its tip, the same [rad/N]
    turning: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))


class TipSense:
    """Reads the tip with the nominal arm: no more is known of a cell.

    A force is what remains of the torques without gravity, J^T f. Offsets of torque sensors, errors of the
    load and friction of joints at rest pass for some 3 N, and change by 1 N from one action to the next.

    Args:
        cell: of which the tool arm.
        tool: its payload, and where its tip is.
    """

    def __init__(self, cell: CellSpec, tool: Tool) -> None:
        load = Payload(tool.mass, tool.center_of_mass, tool.inertia)
        self._arm = ArmModel(cell.tool_arm, cell.tool_base_in_world, load)
        self._tip_in_flange = tool.tip_in_flange.position
        self._stiffness = cell.tool_arm.controller.stiffness

    def read(self, arm: ArmReading) -> TipReading:
        """What the joints say of the tip.

        Raises:
            InputError: the reading has another number of joints, or values that are not finite.
        """
        position, rotation, flange = self._arm.flange_and_jacobian(arm.position)
        lever = rotation @ self._tip_in_flange
        x, y, z = lever
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        jacobian = np.vstack([flange[:3] - cross @ flange[3:], flange[3:]])
        torque = arm.effort - self._arm.gravity(arm.position)
        wrench, *_ = np.linalg.lstsq(jacobian.T, torque, rcond=None)
        compliance = (jacobian / self._stiffness) @ jacobian.T
        return TipReading(position + lever, wrench[:3], compliance[:3, :3], compliance[3:, :3])
