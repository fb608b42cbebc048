"""The task's bodies in a PyBullet client: fixed and movable ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pybullet

from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Body
from samrl_core.cell.world.pybullet.body_files import write_body_urdf
from samrl_core.cell.world.settings import WorldSettings

_UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])


class PyBulletBodies:
    """Bodies by name, and how high the movable ones have been.

    Args:
        client: physics client.
        bodies: to be built; their files go into `folder`.
        folder: for URDF and OBJ files.
        settings: of the contacts.

    Raises:
        InputError: a body cannot be built.
    """

    def __init__(self, client: int, bodies: tuple[Body, ...], folder: Path, settings: WorldSettings) -> None:
        """Load all of them at the origin."""
        self._client = client
        self._placed: dict[str, Pose] = {}
        self._peak: dict[str, float] = {}
        self._movable = [body.name for body in bodies if body.mass > 0.0]
        self.index: dict[str, int] = {}
        for body in bodies:
            index = pybullet.loadURDF(
                str(write_body_urdf(body, folder)),
                useFixedBase=body.mass == 0.0,
                # As for the arms: the file's inertia, and cylinders without hulls and margins.
                flags=pybullet.URDF_USE_INERTIA_FROM_FILE | pybullet.URDF_USE_IMPLICIT_CYLINDER,
                physicsClientId=client,
            )
            soften(client, index, body.friction, settings)
            pybullet.changeDynamics(index, -1, linearDamping=0.0, angularDamping=0.0, physicsClientId=client)
            if body.rounding > 0.0:
                # Bullet rounds the edges of boxes and cylinders, within their outlines, by their margin.
                pybullet.changeDynamics(index, -1, collisionMargin=body.rounding, physicsClientId=client)
            self.index[body.name] = index

    def place(self, poses: dict[str, Pose]) -> None:
        """Put every body at its pose in world, at rest, and forget how high it was."""
        for name, pose in poses.items():
            position, quat = pose.position.tolist(), pose.quat_xyzw.tolist()
            pybullet.resetBasePositionAndOrientation(
                self.index[name], position, quat, physicsClientId=self._client
            )
        for name in self._movable:
            pybullet.resetBaseVelocity(self.index[name], [0.0] * 3, [0.0] * 3, physicsClientId=self._client)
        self._placed = dict(poses)
        self._peak = {name: float(pose.position[2]) for name, pose in poses.items()}

    def forget_contacts(self) -> None:
        """Drop what the solver remembers of contacts: the next episode would start a little differently."""
        away = {name: Pose(np.array([0.0, 0.0, 10.0 + k]), _UPRIGHT) for k, name in enumerate(self._movable)}
        for name, pose in away.items():
            pybullet.resetBasePositionAndOrientation(
                self.index[name],
                pose.position.tolist(),
                pose.quat_xyzw.tolist(),
                physicsClientId=self._client,
            )
        pybullet.performCollisionDetection(physicsClientId=self._client)

    def watch(self) -> None:
        """Note how high the movable bodies are now."""
        for name in self._movable:
            position, _ = pybullet.getBasePositionAndOrientation(
                self.index[name], physicsClientId=self._client
            )
            self._peak[name] = max(self._peak[name], position[2])

    def poses(self) -> dict[str, Pose]:
        """True poses in world; fixed bodies are exactly where they were placed."""
        poses = dict(self._placed)
        for name in self._movable:
            position, quat = pybullet.getBasePositionAndOrientation(
                self.index[name], physicsClientId=self._client
            )
            poses[name] = Pose(np.array(position), np.array(quat) / np.linalg.norm(quat))
        return poses

    def speeds(self) -> dict[str, float]:
        """Speed of every body's origin [m/s]."""
        speeds = dict.fromkeys(self._placed, 0.0)
        for name in self._movable:
            linear, _ = pybullet.getBaseVelocity(self.index[name], physicsClientId=self._client)
            speeds[name] = float(np.linalg.norm(linear))
        return speeds

    def peak_heights(self) -> dict[str, float]:
        """Highest z of every body's origin since it was placed [m]."""
        return dict(self._peak)


def soften(client: int, body: int, friction: float, settings: WorldSettings) -> None:
    """Give a body its friction and the world's compliant contact."""
    pybullet.changeDynamics(
        body,
        -1,
        # Bullet multiplies the two coefficients of a pair; roots make it their geometric mean.
        lateralFriction=float(np.sqrt(friction)),
        contactStiffness=settings.contact_stiffness,
        contactDamping=settings.contact_damping,
        physicsClientId=client,
    )
