"""The chain that hangs from the tool in a PyBullet client."""

from __future__ import annotations

import numpy as np
import pybullet

from samrl_core.cell.tasks.chain import checked_angles, holding_torque
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import ChainLink
from samrl_core.cell.world.pybullet.body_files import joint_names
from samrl_core.cell.world.pybullet.chain_springs import ChainSprings, ChainState


class PyBulletChain:
    """Sprung links that are part of an arm's multibody.

    Args:
        client: physics client.
        body: the arm that the chain is part of.
        link_index: PyBullet's number per link name; a joint has its child link's number.
        chain: K links, K may be 0.
        period_s: of the physics [s].
        gravity: acceleration in world (3,) [m/s2].
    """

    def __init__(
        self,
        client: int,
        body: int,
        link_index: dict[str, int],
        chain: tuple[ChainLink, ...],
        period_s: float,
        gravity: np.ndarray,
    ) -> None:
        """Sets the links' friction and frees the joints of PyBullet's motors."""
        self._client, self._body, self._chain, self._gravity = client, body, chain, gravity
        self.links = [link_index[link.name] for link in chain]
        by_joint = {
            pybullet.getJointInfo(body, i, physicsClientId=client)[1].decode(): i for i in link_index.values()
        }
        self._joints = [by_joint[name] for link in chain for name in joint_names(link)]
        self._springs = ChainSprings(chain, period_s, gravity)
        self._rest = np.zeros(len(self._joints))
        for link, index in zip(chain, self.links, strict=True):
            pybullet.changeDynamics(
                body, index, lateralFriction=float(np.sqrt(link.friction)), physicsClientId=client
            )
        if chain:
            pybullet.setJointMotorControlArray(
                body,
                self._joints,
                pybullet.VELOCITY_CONTROL,
                forces=[0.0] * len(self._joints),
                physicsClientId=client,
            )

    def place(self, angles: np.ndarray, tip_in_world: Pose) -> None:
        """Put the joints at `angles` (2 K,) [rad], at rest; the springs are made so that they hold there.

        Raises:
            InputError: not two finite angles per link.
        """
        angles = checked_angles(self._chain, angles)
        if not self._chain:
            return
        holding = holding_torque(self._chain, tip_in_world, angles, self._gravity)
        self._rest = angles + holding / self._springs.stiffness
        for joint, angle in zip(self._joints, angles.tolist(), strict=True):
            pybullet.resetJointState(self._body, joint, angle, 0.0, physicsClientId=self._client)

    def push(self, tip_in_world: Pose) -> None:
        """Torque of the springs for the next step only; the tool's tip is at `tip_in_world`."""
        if not self._chain:
            return
        pybullet.setJointMotorControlArray(
            self._body,
            self._joints,
            pybullet.TORQUE_CONTROL,
            forces=self._springs.torque(self.state(tip_in_world), self._rest).tolist(),
            physicsClientId=self._client,
        )

    def state(self, tip_in_world: Pose) -> ChainState:
        """True state."""
        position, quat = self._frames()
        joints = pybullet.getJointStates(self._body, self._joints, physicsClientId=self._client)
        angle, speed = np.array([joint[:2] for joint in joints]).T
        return ChainState(tip_in_world.rotation, position, _rotations(quat), angle, speed)

    def points(self) -> np.ndarray:
        """True places of the joints and of the chain's end in world, (K + 1, 3) [m]; (0, 3) without links."""
        if not self._chain:
            return np.zeros((0, 3))
        position, quat = self._frames()
        end = position[-1] + self._chain[-1].length * _rotations(quat)[-1, :, 2]
        return np.vstack([position, end])

    def _frames(self) -> tuple[np.ndarray, np.ndarray]:
        states = pybullet.getLinkStates(
            self._body, self.links, computeForwardKinematics=True, physicsClientId=self._client
        )
        return np.array([state[4] for state in states]), np.array([state[5] for state in states])


def _rotations(quat_xyzw: np.ndarray) -> np.ndarray:
    """Rotation matrices (K, 3, 3) of quaternions (K, 4) that are of unit length to 1e-7 only."""
    x, y, z, w = (quat_xyzw / np.linalg.norm(quat_xyzw, axis=1, keepdims=True)).T
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )
    return np.array(rows).transpose(2, 0, 1)
