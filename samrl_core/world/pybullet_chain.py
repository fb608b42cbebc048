"""The chain that hangs from the tool: sprung joints that stay stable at the controller's rate."""

from __future__ import annotations

import numpy as np
import pybullet

from samrl_core.tasks.chain import checked_angles, holding_torque
from samrl_core.types.pose import Pose
from samrl_core.types.scene import ChainLink
from samrl_core.world.body_files import joint_names


class PyBulletChain:
    """Springs by PyBullet's joint motors.

    A thread's link has so little inertia (1e-8 kg m2) that a spring's torque, held over a period, would throw
    it to and fro. So a motor, which PyBullet solves together with the contacts, drives each joint towards
    its rest angle with no more torque than the spring's, k |rest - q|, and no faster than a massless spring
    with the damper d would, k (rest - q) / d. At rest that is the spring; a motor so bounded adds no energy
    that the spring does not hold.

    Args:
        client: physics client.
        body: the arm that the chain is part of.
        link_index: PyBullet's number per link name; a joint has its child link's number.
        chain: K links, K may be 0.
        period_s: of the physics [s].
    """

    def __init__(
        self,
        client: int,
        body: int,
        link_index: dict[str, int],
        chain: tuple[ChainLink, ...],
        period_s: float,
    ) -> None:
        """Sets the links' friction and finds the joints."""
        self._client, self._body, self._chain = client, body, chain
        self.links = [link_index[link.name] for link in chain]
        by_joint = {
            pybullet.getJointInfo(body, i, physicsClientId=client)[1].decode(): i for i in link_index.values()
        }
        self._joints = [by_joint[name] for link in chain for name in joint_names(link)]
        self._stiffness = np.repeat([link.stiffness for link in chain], 2)
        damping = np.repeat([link.damping for link in chain], 2)
        self._gains = (period_s * self._stiffness / np.maximum(damping, period_s * self._stiffness)).tolist()
        self._rest = np.zeros(len(self._joints))
        for link, index in zip(chain, self.links, strict=True):
            pybullet.changeDynamics(
                body, index, lateralFriction=float(np.sqrt(link.friction)), physicsClientId=client
            )

    def place(self, angles: np.ndarray, tip_in_world: Pose, gravity: np.ndarray) -> None:
        """Put the joints at `angles` (2 K,) [rad], at rest; the springs are made so that they hold there."""
        if not self._joints:
            return
        angles = checked_angles(self._chain, angles)
        holding = holding_torque(self._chain, tip_in_world, angles, gravity)
        self._rest = angles + holding / self._stiffness
        for joint, angle in zip(self._joints, angles.tolist(), strict=True):
            pybullet.resetJointState(self._body, joint, angle, 0.0, physicsClientId=self._client)

    def hold(self) -> None:
        """Set the springs for the next step."""
        if not self._joints:
            return
        bound = self._stiffness * np.abs(self._rest - self.angles())
        pybullet.setJointMotorControlArray(
            self._body,
            self._joints,
            pybullet.POSITION_CONTROL,
            targetPositions=self._rest.tolist(),
            forces=bound.tolist(),
            positionGains=self._gains,
            velocityGains=[1.0] * len(self._joints),
            physicsClientId=self._client,
        )

    def angles(self) -> np.ndarray:
        """True angles (2 K,) [rad]."""
        states = pybullet.getJointStates(self._body, self._joints, physicsClientId=self._client)
        return np.array([state[0] for state in states])

    def points(self) -> np.ndarray:
        """True places of the joints and of the chain's end in world, (K + 1, 3) [m]; (0, 3) without links."""
        if not self.links:
            return np.zeros((0, 3))
        states = pybullet.getLinkStates(
            self._body, self.links, computeForwardKinematics=True, physicsClientId=self._client
        )
        last = np.array(states[-1][5])
        end = Pose(np.array(states[-1][4]), last / np.linalg.norm(last))
        return np.array([*(s[4] for s in states), end.apply(np.array([0.0, 0.0, self._chain[-1].length]))])
