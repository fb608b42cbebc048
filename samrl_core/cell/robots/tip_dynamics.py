"""How an arm's tool tip answers to forces along one direction: effective mass, and motion without contact."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError

RATE_STEP_S = 1.0e-4  # over which the Jacobian's rate is a difference [s]


class TipDynamics:
    """The tip of a tool on an arm, along one fixed direction u in base axes.

    With u^T f the only outside force, at the tip, the arm obeys x'' = a + f / m: x is the tip's place along
    u, m = 1 / (u^T J M^-1 J^T u) its effective mass (Khatib 1987, eq. for the operational space's kinetic
    energy matrix along one direction), and a the acceleration that the drives' torque alone would give. That
    holds whatever the controller does in the other directions, because its torque is part of a.

    Args:
        arm: with the tool as its payload.
        tip_in_flange: the point that is pushed with.
        direction: (3,) of unit length, in the arm's base axes.

    Raises:
        InputError: the direction is not of unit length.
    """

    def __init__(self, arm: ArmModel, tip_in_flange: Pose, direction: np.ndarray) -> None:
        u = np.asarray(direction, dtype=np.float64)
        if u.shape != (3,) or abs(float(np.linalg.norm(u)) - 1.0) > 1e-6:
            raise InputError(f"direction {direction} must have 3 components and length 1; normalise it")
        self._arm, self._tip, self._direction = arm, tip_in_flange, u

    def position(self, q: np.ndarray) -> np.ndarray:
        """Tip in the base, (3,) [m]."""
        return self._arm.flange_in_base(q).apply(self._tip.position)

    def gradient(self, q: np.ndarray) -> np.ndarray:
        """u^T J: how the place along u changes with the joints, (J,) [m/rad]."""
        return self._direction @ self._jacobian(q)

    def effective_mass(self, q: np.ndarray) -> float:
        """m at joint positions q (J,) [kg].

        Raises:
            InputError: at a singularity, where the arm cannot move along the direction.
        """
        gradient = self.gradient(q)
        if float(np.linalg.norm(gradient)) < 1e-9:
            raise InputError(f"the arm cannot move along {self._direction} at {q} rad; choose another pose")
        return 1.0 / float(gradient @ np.linalg.solve(self._arm.mass_matrix(q), gradient))

    def free_acceleration(self, q: np.ndarray, dq: np.ndarray, tau: np.ndarray) -> float:
        """a under torques tau (J,) [N m], gravity included, at q [rad] and dq [rad/s], in [m/s2]."""
        q, dq = np.asarray(q, dtype=np.float64), np.asarray(dq, dtype=np.float64)
        rate = (self.gradient(q + RATE_STEP_S * dq) - self.gradient(q - RATE_STEP_S * dq)) / (2 * RATE_STEP_S)
        return float(self.gradient(q) @ self._arm.forward_dynamics(q, dq, tau) + rate @ dq)

    def _jacobian(self, q: np.ndarray) -> np.ndarray:
        """Of the tip's position (3, J), base axes."""
        _, rotation, jacobian = self._arm.flange_and_jacobian(q)
        x, y, z = rotation @ self._tip.position
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        return jacobian[:3] - cross @ jacobian[3:]
