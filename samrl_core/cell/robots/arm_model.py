"""Rigid-body kinematics and dynamics of one arm with what it carries, on Pinocchio."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from samrl_core.cell.robots.robot import CellSpec, RobotSpec
from samrl_core.cell.robots.urdf import check_robot
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Tool
from samrl_core.common.errors import InputError


@dataclass(frozen=True, eq=False)
class Payload:
    """What is fixed to the flange.

    Raises:
        InputError: a mass that is not positive, a wrong shape, or an inertia that no body can have.
    """

    mass: float  # [kg]
    center_of_mass: np.ndarray  # (3,) in the flange frame [m]
    inertia: np.ndarray  # (3, 3) about the centre of mass, flange axes [kg m2]

    def __post_init__(self) -> None:
        if not (np.isfinite(self.mass) and self.mass > 0):
            raise InputError(
                f"payload mass {self.mass} kg must be positive and finite; pass None for no payload"
            )
        if np.shape(self.center_of_mass) != (3,) or np.shape(self.inertia) != (3, 3):
            raise InputError("payload needs a centre of mass (3,) and an inertia (3, 3)")
        if not (np.isfinite(self.center_of_mass).all() and np.isfinite(self.inertia).all()):
            raise InputError("payload centre of mass or inertia has a value that is not finite")
        moments = np.linalg.eigvalsh(self.inertia)
        if not np.allclose(self.inertia, np.transpose(self.inertia)) or moments[0] < 0:
            raise InputError(f"payload inertia must be symmetric and positive, principal moments {moments}")
        if moments[2] > (moments[0] + moments[1]) * (1 + 1e-6):
            raise InputError(
                f"payload principal moments {moments} break the triangle inequality of real bodies"
            )


def nominal_payloads(cell: CellSpec, tool: Tool) -> dict[str, Payload]:
    """What each arm of a cell carries, by role, as it is described."""
    return {
        "tool_arm": Payload(tool.mass, tool.center_of_mass, tool.inertia),
        "camera_arm": Payload(cell.camera_mass, cell.camera_center_of_mass, cell.camera_inertia),
    }


class ArmModel:
    """Maps of joint positions q (J,) [rad], velocities dq, accelerations ddq and torques tau (J,) [N m].

    Rotor inertia (`RobotSpec.armature`) is counted in the dynamics. Not safe to share between threads:
    Pinocchio works in one scratch space per model.

    Raises:
        InputError: the spec does not fit its URDF; in every method, an array of the wrong length or with
            a value that is not finite.
    """

    def __init__(self, spec: RobotSpec, base_in_world: Pose, payload: Payload | None) -> None:
        """Read the URDF and add the payload to the last moving link."""
        check_robot(spec)
        self.spec = spec
        self.base_in_world = base_in_world
        model: Any = pin.buildModelFromUrdf(str(spec.urdf))
        found = tuple(model.names)[1:]
        if found != spec.joint_names:
            raise InputError(
                f"joints of {spec.urdf} along the chain are {found}, robot '{spec.name}' orders them "
                f"{spec.joint_names}; order the spec from base to flange"
            )
        self._flange = model.getFrameId(spec.flange)
        flange = model.frames[self._flange]
        if payload is not None:
            inertia = pin.Inertia(
                float(payload.mass),
                np.asarray(payload.center_of_mass, float),
                np.asarray(payload.inertia, float),
            )
            joint = flange.parentJoint
            model.inertias[joint] = model.inertias[joint] + flange.placement.act(inertia)
        # Gravity is given in world axes, the model lives in the axes of the base.
        model.gravity.linear = base_in_world.rotation.T @ np.array([0.0, 0.0, -9.81])
        model.armature = np.asarray(spec.armature, dtype=np.float64)
        self._base_placement = pin.SE3(base_in_world.matrix())
        self._model = model
        self._data: Any = model.createData()
        self._links = [(f.name, i) for i, f in enumerate(model.frames) if f.type == pin.FrameType.BODY]

    def flange_in_base(self, q: np.ndarray) -> Pose:
        """Flange pose in the base link."""
        q = self._checked("position", q)
        pin.forwardKinematics(self._model, self._data, q)
        return _pose(self._placement(self._flange))

    def flange_in_world(self, q: np.ndarray) -> Pose:
        """Flange pose in world."""
        pin.forwardKinematics(self._model, self._data, self._checked("position", q))
        return _pose(self._base_placement * self._placement(self._flange))

    def link_poses_in_world(self, q: np.ndarray) -> dict[str, Pose]:
        """Pose of every link of the URDF, parents before children."""
        pin.framesForwardKinematics(self._model, self._data, self._checked("position", q))
        return {name: _pose(self._base_placement * self._data.oMf[i]) for name, i in self._links}

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """Jacobian of the flange (6, J): linear rows first, at the flange's origin, in base axes."""
        q = self._checked("position", q)
        return pin.computeFrameJacobian(
            self._model, self._data, q, self._flange, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        ).copy()

    def flange_and_jacobian(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Position (3,), rotation (3, 3) and Jacobian (6, J) of the flange in base axes, in one pass."""
        jacobian = self.jacobian(q)
        placement = self._data.oMf[self._flange]
        return placement.translation.copy(), placement.rotation.copy(), jacobian

    def gravity(self, q: np.ndarray) -> np.ndarray:
        """Torque that holds the arm still, (J,)."""
        return pin.computeGeneralizedGravity(self._model, self._data, self._checked("position", q)).copy()

    def inverse_dynamics(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        """Torque for a motion, gravity included, (J,)."""
        q, dq = self._checked("position", q), self._checked("velocity", dq)
        return pin.rnea(self._model, self._data, q, dq, self._checked("acceleration", ddq)).copy()

    def effort_without_gravity(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        """Feed-forward of an `ArmCommand`: the torque for a motion less the gravity torque, (J,)."""
        total = self.inverse_dynamics(q, dq, ddq)
        return total - pin.computeGeneralizedGravity(self._model, self._data, np.asarray(q, dtype=np.float64))

    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        """Joint-space inertia (J, J) [kg m2], rotors included."""
        upper = np.triu(pin.crba(self._model, self._data, self._checked("position", q)))
        return upper + np.triu(upper, 1).T

    def forward_dynamics(self, q: np.ndarray, dq: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Joint accelerations (J,) [rad/s2] under torques, gravity acting, nothing touched."""
        q, dq = self._checked("position", q), self._checked("velocity", dq)
        return pin.aba(self._model, self._data, q, dq, self._checked("effort", tau)).copy()

    def _placement(self, frame: int) -> Any:
        # `check_robot` made sure that the base link is the root, so "in base" is Pinocchio's world.
        return pin.updateFramePlacement(self._model, self._data, frame)

    def _checked(self, quantity: str, values: np.ndarray) -> np.ndarray:
        array = np.asarray(values, dtype=np.float64)
        names = self.spec.joint_names
        if array.shape != (len(names),):
            raise InputError(
                f"joint {quantity} of '{self.spec.name}' has shape {array.shape}, must be ({len(names)},) "
                f"for {names[0]}..{names[-1]}"
            )
        if not np.isfinite(array).all():
            bad = [n for n, v in zip(names, array, strict=True) if not np.isfinite(v)]
            raise InputError(f"joint {quantity} of '{self.spec.name}' is not finite at {bad}: {array}")
        return array


def _pose(placement: Any) -> Pose:
    # Pinocchio's own conversion: the general one also checks that the matrix is a rotation, ten times slower.
    return Pose(placement.translation, pin.Quaternion(placement.rotation).coeffs())
