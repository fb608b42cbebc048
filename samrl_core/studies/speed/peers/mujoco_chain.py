"""The chain in MuJoCo, C, float64: forward, and gradients by its own finite differences of a step."""
# The library's stubs lack or misstate these.

from __future__ import annotations

import mujoco
import numpy as np

from samrl_core.studies.speed.physics_scenes import (
    DAMPING,
    LENGTH,
    LINKS,
    MASS,
    RADIUS,
    STEP_S,
    chain_start,
    cylinder_inertia,
)


def chain_xml() -> str:
    """The same ten links, semi-implicit Euler, nothing touches."""
    side, _, along = np.diag(cylinder_inertia(MASS, RADIUS, LENGTH))
    inner = ""
    for i in reversed(range(LINKS)):
        joints = "".join(
            f'<joint type="hinge" axis="{axis}" damping="{DAMPING}"/>' for axis in ("1 0 0", "0 1 0")
        )
        inner = (
            f'<body pos="0 0 {-LENGTH if i else 0}"><inertial pos="0 0 {-LENGTH / 2}" mass="{MASS}" '
            f'diaginertia="{side} {side} {along}"/>{joints}{inner}</body>'
        )
    option = f'<option timestep="{STEP_S}" gravity="0 0 -9.81" integrator="Euler"/>'
    return f"<mujoco>{option}<worldbody>{inner}</worldbody></mujoco>"


class MujocoChain:
    """Rollouts of some steps of one chain."""

    def __init__(self, steps: int) -> None:
        self._model = mujoco.MjModel.from_xml_string(chain_xml())
        self._data = mujoco.MjData(self._model)
        self._steps = steps
        self._start = chain_start()
        size = 2 * self._model.nv
        self._jacobian = np.zeros((size, size))

    def _reset(self) -> None:
        mujoco.mj_resetData(self._model, self._data)
        self._data.qpos[:], self._data.qvel[:] = self._start

    def forward(self) -> None:
        """All steps in one call of C."""
        self._reset()
        mujoco.mj_step(self._model, self._data, self._steps)

    def both(self) -> None:
        """Steps with the Jacobian of each, then the vector product backwards."""
        self._reset()
        jacobians = []
        for _ in range(self._steps):
            mujoco.mjd_transitionFD(self._model, self._data, 1e-6, False, self._jacobian, None, None, None)
            jacobians.append(self._jacobian.copy())
            mujoco.mj_step(self._model, self._data)
        gradient = np.ones(len(self._jacobian))
        for jacobian in reversed(jacobians):
            gradient = jacobian.T @ gradient

    @property
    def last(self) -> np.ndarray:
        """Angles (20,) where the last rollout ended [rad]."""
        return self._data.qpos.copy()
