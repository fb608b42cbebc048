"""Physics engines by name: PyBullet and MuJoCo here, Pinocchio in a file of its own."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pybullet

from samrl_core.blind_test.engines.arm_body import ArmBody
from samrl_core.blind_test.engines.engine import Engine
from samrl_core.blind_test.engines.engine_files import mjcf_text, urdf_text
from samrl_core.blind_test.engines.pinocchio_engine import PinocchioEngine
from samrl_core.common.errors import InputError

ENGINES = ("pybullet", "mujoco", "pinocchio")
_MUJOCO: Any = mujoco  # a compiled module without type stubs


class BulletEngine(Engine):
    """PyBullet without a window; it knows no rotors, so their torque is taken off before the step."""

    def __init__(self, body: ArmBody, timestep: float) -> None:
        """Load the arm."""
        self.timestep = timestep
        self._client = pybullet.connect(pybullet.DIRECT)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "arm.urdf"
            path.write_text(urdf_text(body))
            self._body = pybullet.loadURDF(
                str(path),
                useFixedBase=True,
                flags=pybullet.URDF_USE_INERTIA_FROM_FILE,
                physicsClientId=self._client,
            )
        self._n = pybullet.getNumJoints(self._body, physicsClientId=self._client)
        self._joints = list(range(self._n))
        for link in range(-1, self._n):
            pybullet.changeDynamics(
                self._body,
                link,
                linearDamping=0.0,
                angularDamping=0.0,
                jointDamping=0.0,
                maxJointVelocity=1e4,
                physicsClientId=self._client,
            )
        # Every joint is born with a velocity motor that acts as friction.
        pybullet.setJointMotorControlArray(
            self._body,
            self._joints,
            pybullet.VELOCITY_CONTROL,
            forces=[0.0] * self._n,
            physicsClientId=self._client,
        )
        pybullet.setTimeStep(timestep, physicsClientId=self._client)
        self._zeros = [0.0] * self._n

    def place(self, position: np.ndarray) -> None:
        """As `Engine`."""
        for joint, value in enumerate(position.tolist()):
            pybullet.resetJointState(self._body, joint, value, 0.0, physicsClientId=self._client)
        self._read()

    def gravity(self, vector: np.ndarray) -> None:
        """As `Engine`."""
        pybullet.setGravity(*vector.tolist(), physicsClientId=self._client)

    def dynamics(self) -> tuple[np.ndarray, list[float]]:
        """As `Engine`."""
        mass = pybullet.calculateMassMatrix(self._body, self.position, physicsClientId=self._client)
        bias = pybullet.calculateInverseDynamics(
            self._body, self.position, self.velocity, self._zeros, physicsClientId=self._client
        )
        return np.array(mass), list(bias)

    def step(self, effort: list[float], rotor: list[float], acceleration: list[float]) -> list[float]:
        """As `Engine`."""
        link = [e - r * a for e, r, a in zip(effort, rotor, acceleration, strict=True)]
        pybullet.setJointMotorControlArray(
            self._body,
            self._joints,
            pybullet.TORQUE_CONTROL,
            forces=link,
            physicsClientId=self._client,
        )
        pybullet.stepSimulation(physicsClientId=self._client)
        self._read()
        return link

    def _read(self) -> None:
        states = pybullet.getJointStates(self._body, self._joints, physicsClientId=self._client)
        self.position = [state[0] for state in states]
        self.velocity = [state[1] for state in states]

    def close(self) -> None:
        """As `Engine`."""
        pybullet.disconnect(physicsClientId=self._client)


class MujocoEngine(Engine):
    """MuJoCo, with rotors (`armature`), and with the friction floor by its own solver."""

    def __init__(self, body: ArmBody, timestep: float, coulomb: np.ndarray, viscous: np.ndarray) -> None:
        """Load the arm; `coulomb` [N m] and `viscous` [N m s/rad] (n,) are frictionloss and damping."""
        self.timestep = timestep
        self._model = _MUJOCO.MjModel.from_xml_string(mjcf_text(body, timestep))
        self._data = _MUJOCO.MjData(self._model)
        self._model.dof_frictionloss[:] = coulomb
        self._model.dof_damping[:] = viscous
        self._mass = np.zeros((self._model.nv, self._model.nv))
        self._rotor = [0.0] * self._model.nv
        self._rotors = np.zeros_like(self._mass)

    def place(self, position: np.ndarray) -> None:
        """As `Engine`."""
        self._data.qpos[:] = position
        self._data.qvel[:] = 0.0
        self._read()

    def gravity(self, vector: np.ndarray) -> None:
        """As `Engine`."""
        self._model.opt.gravity[:] = vector

    def dynamics(self) -> tuple[np.ndarray, list[float]]:
        """As `Engine`."""
        _MUJOCO.mj_step1(self._model, self._data)
        _MUJOCO.mj_fullM(self._model, self._data, self._mass)
        return self._mass - self._rotors, self._data.qfrc_bias.tolist()

    def step(self, effort: list[float], rotor: list[float], acceleration: list[float]) -> list[float]:
        """As `Engine`."""
        if rotor != self._rotor:
            self._rotor = rotor.copy()
            self._rotors = np.diag(rotor)
            self._model.dof_armature[:] = rotor
            _MUJOCO.mj_step1(self._model, self._data)
        data = self._data
        data.qfrc_applied[:] = effort
        _MUJOCO.mj_step2(self._model, data)
        # The step's mean acceleration: `implicitfast` adds implicit damping to `qacc`.
        change = (data.qvel - self.velocity) / self.timestep
        drag = self._model.dof_damping * data.qvel
        link = effort + data.qfrc_constraint - drag - self._model.dof_armature * change
        self._read()
        return link.tolist()

    def _read(self) -> None:
        self.position, self.velocity = self._data.qpos.tolist(), self._data.qvel.tolist()

    def close(self) -> None:
        """As `Engine`."""


def make_engine(
    name: str, body: ArmBody, timestep: float, coulomb: np.ndarray, viscous: np.ndarray
) -> Engine:
    """An engine by name; only MuJoCo takes the friction floor (n,) itself.

    Raises:
        InputError: unknown name.
    """
    if name == "pybullet":
        return BulletEngine(body, timestep)
    if name == "mujoco":
        return MujocoEngine(body, timestep, coulomb, viscous)
    if name == "pinocchio":
        return PinocchioEngine(body, timestep)
    raise InputError(f"unknown engine '{name}'; known are {ENGINES}")
