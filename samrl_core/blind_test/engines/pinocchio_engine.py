"""The third engine: Pinocchio's recursions with a leapfrog of our own.

Pinocchio, not Drake: it is a dependency already, its recursions are nobody else's here, and worlds need no
contacts, for which alone Drake's hundred megabytes would pay. The chain is built joint by joint from the
bodies; no URDF or MJCF is read, so that no reader's choice (principal axes, defaults) is shared with the
other engines.

Leapfrog: v' = v + dt (M + R)^-1 (effort - h(q, (v + v') / 2)), then q' = q + dt v'. Velocities stand half a
step before positions, as in the other two engines; the velocity-dependent part is taken at the step's
middle, which they do not do.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from samrl_core.blind_test.engines.arm_body import ArmBody, MovingLink
from samrl_core.blind_test.engines.engine import Engine

_CORRECTIONS = 2  # of the middle velocity; the second changes it by less than 1e-9 rad/s


class PinocchioEngine(Engine):
    """Articulated bodies without contacts, limits, or friction of their own."""

    def __init__(self, body: ArmBody, timestep: float) -> None:
        """Build the arm."""
        self.timestep = timestep
        self._model = _chain(body)
        self._data = self._model.createData()
        self._q = np.zeros(self._model.nq)
        self._v = np.zeros(self._model.nv)
        self._mass = np.zeros((self._model.nv, self._model.nv))
        self._read()

    def place(self, position: np.ndarray) -> None:
        """As `Engine`."""
        self._q = np.array(position, dtype=float)
        self._v = np.zeros(self._model.nv)
        self._read()

    def gravity(self, vector: np.ndarray) -> None:
        """As `Engine`."""
        self._model.gravity.linear = np.asarray(vector, dtype=float)

    def dynamics(self) -> tuple[np.ndarray, list[float]]:
        """As `Engine`."""
        upper = np.triu(pin.crba(self._model, self._data, self._q))
        self._mass = upper + np.triu(upper, 1).T
        bias = pin.nonLinearEffects(self._model, self._data, self._q, self._v)
        return self._mass.copy(), bias.tolist()

    def step(self, effort: list[float], rotor: list[float], acceleration: list[float]) -> list[float]:
        """As `Engine`, after `dynamics` at the same state."""
        push, turning = np.array(effort), np.array(rotor)
        inverse = np.linalg.inv(self._mass + np.diag(turning))
        found = np.array(acceleration)
        for _ in range(_CORRECTIONS):
            middle = self._v + 0.5 * self.timestep * found
            found = inverse @ (push - pin.nonLinearEffects(self._model, self._data, self._q, middle))
        self._v = self._v + self.timestep * found
        self._q = self._q + self.timestep * self._v
        self._read()
        return (push - turning * found).tolist()

    def _read(self) -> None:
        self.position, self.velocity = self._q.tolist(), self._v.tolist()

    def close(self) -> None:
        """As `Engine`."""


def _chain(body: ArmBody) -> pin.Model:
    model, parent = pin.Model(), 0
    for link in body.links:
        pose = link.placement_in_parent
        at = pin.SE3(np.asarray(pose.rotation), np.asarray(pose.position))
        parent = model.addJoint(parent, _joint(link), at, link.joint)
        inertia = pin.Inertia(link.mass, np.asarray(link.center_of_mass), np.asarray(link.inertia))
        model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
    return model


def _joint(link: MovingLink) -> pin.JointModel:
    axis = np.asarray(link.axis, dtype=float)
    return pin.JointModelPrismaticUnaligned(axis) if link.slides else pin.JointModelRevoluteUnaligned(axis)
