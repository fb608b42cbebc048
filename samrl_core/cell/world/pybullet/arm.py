"""One arm in a PyBullet client: torque in, true state and payload out."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np
import pybullet

from samrl_core.cell.robots.robot import RobotSpec
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import ChainLink
from samrl_core.cell.world.pybullet.arm_meshes import MeshVisual
from samrl_core.cell.world.pybullet.body_files import PAYLOAD_LINK, Mounted, write_arm_urdf
from samrl_core.common.errors import InputError


class PyBulletArm:
    """A fixed-base arm without motors or dampers; its joints have friction if it is asked for.

    Raises:
        InputError: the URDF lacks one of the specified joints.
    """

    def __init__(
        self,
        client: int,
        spec: RobotSpec,
        base_in_world: Pose,
        mounted: Mounted,
        folder: Path,
        chain: tuple[ChainLink, ...] = (),
        tip_in_flange: Pose | None = None,
        friction: float | np.ndarray = 0.0,
        meshes: Mapping[str, Sequence[MeshVisual]] | None = None,
    ) -> None:
        """Load the arm with its payload; a chain hangs at `tip_in_flange`, by default the flange.

        `friction` is Coulomb's, of all joints alike or of each (J,) [N m]. `meshes` by link are to be seen.
        """
        self._client = client
        self.body: int = pybullet.loadURDF(
            str(write_arm_urdf(spec, mounted, folder, chain, tip_in_flange or Pose.identity(), meshes or {})),
            base_in_world.position.tolist(),
            base_in_world.quat_xyzw.tolist(),
            useFixedBase=True,
            # Without the first, PyBullet puts the collision shapes' inertias for the file's; without the
            # second, cylinders become 32-sided hulls with a margin that makes the peg 1 mm wider and longer.
            flags=pybullet.URDF_USE_INERTIA_FROM_FILE | pybullet.URDF_USE_IMPLICIT_CYLINDER,
            physicsClientId=client,
        )
        infos = [
            pybullet.getJointInfo(self.body, i, physicsClientId=client)
            for i in range(pybullet.getNumJoints(self.body, physicsClientId=client))
        ]
        by_joint = {info[1].decode(): info[0] for info in infos}
        self.link_index: dict[str, int] = {info[12].decode(): info[0] for info in infos}
        missing = [name for name in spec.joint_names if name not in by_joint]
        if missing:
            raise InputError(f"{spec.urdf.name} has no joint {missing}; it has {sorted(by_joint)}")
        self._joints = [by_joint[name] for name in spec.joint_names]
        self.payload_link = self.link_index[PAYLOAD_LINK]
        self.flange_link = self.link_index[spec.flange]
        self.links = range(-1, len(infos))
        for link in self.links:
            pybullet.changeDynamics(
                self.body,
                link,
                linearDamping=0.0,
                angularDamping=0.0,
                jointDamping=0.0,
                physicsClientId=client,
            )
        # Bullet multiplies the two friction coefficients of a pair; roots make it their geometric mean.
        pybullet.changeDynamics(
            self.body,
            self.payload_link,
            lateralFriction=float(np.sqrt(mounted.friction)),
            physicsClientId=client,
        )
        # Every joint is born with a velocity motor; at speed 0 it acts as friction of its greatest torque.
        pybullet.setJointMotorControlArray(
            self.body,
            self._joints,
            pybullet.VELOCITY_CONTROL,
            forces=np.broadcast_to(friction, len(self._joints)).tolist(),
            physicsClientId=client,
        )

    def place(self, position: np.ndarray) -> None:
        """Put the joints at `position` (J,) [rad], at rest."""
        for joint, value in zip(self._joints, position.tolist(), strict=True):
            pybullet.resetJointState(self.body, joint, value, 0.0, physicsClientId=self._client)

    def push(self, effort: np.ndarray) -> None:
        """Link-side torque (J,) [N m] for the next step only."""
        pybullet.setJointMotorControlArray(
            self.body,
            self._joints,
            pybullet.TORQUE_CONTROL,
            forces=effort.tolist(),
            physicsClientId=self._client,
        )

    def state(self) -> np.ndarray:
        """True position [rad] and velocity [rad/s], shape (2, J)."""
        states = pybullet.getJointStates(self.body, self._joints, physicsClientId=self._client)
        return np.array([state[:2] for state in states]).T

    def flange_in_world(self) -> Pose:
        """True pose of the flange link."""
        state = pybullet.getLinkState(
            self.body, self.flange_link, computeForwardKinematics=True, physicsClientId=self._client
        )
        quat = np.array(state[5])  # of unit length to 1e-7 only
        return Pose(np.array(state[4]), quat / np.linalg.norm(quat))

    def normal_forces(self, links: Collection[int]) -> list[float]:
        """Normal force at each contact of these links in the last step [N]."""
        contacts = pybullet.getContactPoints(bodyA=self.body, physicsClientId=self._client)
        return [contact[9] for contact in contacts or () if contact[3] in links]
