"""Torque of a chain's springs and dampers, taken at the end of a time step instead of at its start.

A spring and a damper whose torque is held over a period throw a thread's links, of 1e-8 kg m2, to and fro. So
the linearised equation of motion is solved for the speed v at the end of the period h, as in the stable PD
control of Tan, Liu and Turk (2011), with M the chain's mass matrix and g the torque of its weight:
    (M + h D + h^2 K) v = M dq + h (g + K (rest - q)),    torque = K (rest - q - h v) - D v.
Contacts and the gripper's acceleration are not foreseen; they act through the simulator alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from samrl_core.cell.types.scene import ChainLink


@dataclass(frozen=True, eq=False)
class ChainState:
    """Where a chain of K links is, in world."""

    tip_rotation: np.ndarray  # (3, 3) of the tool frame that the first link hangs at
    position: np.ndarray  # (K, 3) of the links' joints [m]
    rotation: np.ndarray  # (K, 3, 3) of the links
    angle: np.ndarray  # (2 K,) [rad]
    speed: np.ndarray  # (2 K,) [rad/s]


class ChainSprings:
    """Springs and dampers of one chain.

    Args:
        chain: K links, one at least.
        period_s: h, over which the torque is held [s].
        gravity: acceleration in world (3,) [m/s2].
    """

    def __init__(self, chain: Sequence[ChainLink], period_s: float, gravity: np.ndarray) -> None:
        """Stack the links' figures."""
        self._period = period_s
        self.stiffness = np.repeat([link.stiffness for link in chain], 2)
        self.damping = np.repeat([link.damping for link in chain], 2)
        self._mass = np.array([link.mass for link in chain])
        self._center = np.array([link.center_of_mass for link in chain])
        self._inertia = np.array([link.inertia for link in chain])
        self._weight = self._mass[:, None] * gravity
        count = len(chain)
        # Joint k, on link k // 2, moves that link and those below.
        self._moves = (np.arange(2 * count)[:, None] // 2 <= np.arange(count)).astype(np.float64)

    def mass_matrix(self, state: ChainState) -> tuple[np.ndarray, np.ndarray]:
        """Mass matrix (2 K, 2 K) [kg m2] and the torque of the weight (2 K,) [N m]."""
        before = np.concatenate([state.tip_rotation[None], state.rotation[:-1]])
        axes = np.stack([before[:, :, 0], state.rotation[:, :, 1]], axis=1).reshape(-1, 3)
        centers = state.position + np.einsum("kij,kj->ki", state.rotation, self._center)
        levers = centers[None] - np.repeat(state.position, 2, axis=0)[:, None]  # (2 K, K, 3)
        x, y, z = axes[:, :1], axes[:, 1:2], axes[:, 2:]
        lx, ly, lz = levers[..., 0], levers[..., 1], levers[..., 2]
        moved = (
            np.stack([y * lz - z * ly, z * lx - x * lz, x * ly - y * lx], axis=2) * self._moves[:, :, None]
        )
        turned = axes[:, None] * self._moves[:, :, None]
        inertia = state.rotation @ self._inertia @ state.rotation.transpose(0, 2, 1)
        n = len(axes)
        linear = (moved * self._mass[:, None]).reshape(n, -1) @ moved.reshape(n, -1).T
        angular = np.einsum("akj,kji->aki", turned, inertia).reshape(n, -1) @ turned.reshape(n, -1).T
        return linear + angular, moved.reshape(n, -1) @ self._weight.ravel()

    def torque(self, state: ChainState, rest: np.ndarray) -> np.ndarray:
        """Torque of the joints (2 K,) [N m] for the next period; at `rest` (2 K,) [rad] springs are slack."""
        h, k, d = self._period, self.stiffness, self.damping
        mass, weight = self.mass_matrix(state)
        bent = rest - state.angle
        left = mass + np.diag(h * d + h * h * k)
        speed = np.linalg.solve(left, mass @ state.speed + h * (weight + k * bent))
        return k * (bent - h * speed) - d * speed
