"""The nominal rigid-body arm of any fixed-base URDF on Pinocchio, vectorised over samples."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

from samrl_core.cell.robots.joint_dynamics import joint_dynamics
from samrl_core.cell.robots.urdf_text import parse_urdf, with_world
from samrl_core.cell.types.arm_description import STANDARD_GRAVITY, ArmDescription, NominalTool
from samrl_core.common.errors import InputError


class RigidArm:
    """Joints q (N, J) [rad or m], dq, ddq to torques (N, J) [N m or N], those of stated springs among them.

    Rotor inertia and friction are not included.

    Joints of the URDF that the description does not list are locked at zero. Inertial parameters of a link
    are Pinocchio's ten: m [kg], m c (3) [kg m], then Ixx Ixy Iyy Ixz Iyz Izz [kg m2] about the joint's frame.

    Raises:
        InputError: no URDF, one that cannot be read, or one without a listed joint.
    """

    def __init__(self, arm: ArmDescription) -> None:
        """Read the URDF, lock what is not listed, add the tool to the flange."""
        if arm.urdf is None:
            raise InputError(f"{arm.role} has no URDF; inverse dynamics needs one")
        parse_urdf(arm.urdf, f"the URDF of {arm.role}")
        text = with_world(arm.urdf)
        try:
            whole = pin.buildModelFromXML(text)
        except (ValueError, RuntimeError, IndexError) as error:
            raise InputError(f"the URDF of {arm.role} cannot be read: {error}") from error
        moving = [name for name in whole.names if name != "universe"]
        if missing := [name for name in arm.joints if name not in moving]:
            raise InputError(f"joints {missing} of {arm.role} are not in its URDF, which has {moving}")
        locked = [whole.getJointId(name) for name in moving if name not in arm.joints]
        model = _reduced(whole, locked) if locked else whole
        gravity = arm.controller.gravity if arm.controller else STANDARD_GRAVITY
        model.gravity = pin.Motion(np.asarray(gravity, dtype=float), np.zeros(3))
        self.joints = arm.joints
        self.model: Any = model
        ids = [model.getJointId(name) for name in arm.joints]
        if any(model.joints[i].nq != 1 and model.joints[i].nv != 1 for i in ids):
            raise InputError("only revolute and prismatic joints with one coordinate are supported")
        self._ids = ids
        self._q_index = [model.joints[i].idx_q for i in ids]
        self._v_index = [model.joints[i].idx_v for i in ids]
        self.screws = np.array([_screw(model, i) for i in ids])  # (J, 6) unit twists in the joints' frames
        self.slides = tuple(bool(screw[:3].any()) for screw in self.screws)  # prismatic, per joint
        self._continuous = [model.joints[i].nq == 2 for i in ids]
        self.flange_joint, self.flange, self.flange_in_joint = _flange(model, ids[-1])
        if arm.tool is not None:
            add_tool(model, self.flange_joint, self.flange_in_joint, arm.tool)
        self.data: Any = model.createData()
        self.links = tuple(_link_of(model, i) for i in ids)
        stated = joint_dynamics(arm)
        self.spring_stiffness, self.spring_rest = stated.stiffness, stated.spring_rest  # (J,)

    @property
    def gravity_vector(self) -> np.ndarray:
        """(3,) in the base frame [m/s2]."""
        return np.array(self.model.gravity.linear)

    @property
    def inertial_parameters(self) -> np.ndarray:
        """(J, 10) of each moving link, tool included in the last."""
        return np.array([self.model.inertias[i].toDynamicParameters() for i in self._ids])

    def effort_limits(self) -> np.ndarray:
        """(J,) from the URDF [N m]; infinite where it states none (zero)."""
        limits = np.array(self.model.upperEffortLimit)[self._v_index]
        return np.where(limits > 0, limits, np.inf)

    def velocity_limits(self) -> np.ndarray:
        """(J,) from the URDF [rad/s]; infinite where it states none (zero)."""
        limits = np.array(self.model.upperVelocityLimit)[self._v_index]
        return np.where(limits > 0, limits, np.inf)

    def position_limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper (J,) [rad]; infinite for continuous joints."""
        lower, upper = np.array(self.model.lowerPositionLimit), np.array(self.model.upperPositionLimit)
        low = [-np.inf if c else lower[i] for i, c in zip(self._q_index, self._continuous, strict=True)]
        high = [np.inf if c else upper[i] for i, c in zip(self._q_index, self._continuous, strict=True)]
        return np.array(low), np.array(high)

    def inverse_dynamics(
        self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, gravity: np.ndarray | None = None
    ) -> np.ndarray:
        """Link-side torques (N, J) of motions; `gravity` (3,) in the base frame replaces the nominal one."""
        model, data = self.model, self.data
        kept = model.gravity.linear.copy()
        if gravity is not None:
            model.gravity.linear = np.asarray(gravity, dtype=float)
        out = np.empty((len(q), len(self._ids)))
        qs, v, a = self._full_q(q), self._full_v(dq), self._full_v(ddq)
        for k in range(len(q)):
            out[k] = pin.rnea(model, data, qs[k], v[k], a[k])[self._v_index]
        model.gravity.linear = kept
        return out + self.spring_torque(q)

    def spring_torque(self, q: np.ndarray) -> np.ndarray:
        """Torques (N, J) that hold stated springs at joint positions (N, J)."""
        return self.spring_stiffness * (np.asarray(q, dtype=float) - self.spring_rest)

    def gravity(self, q: np.ndarray) -> np.ndarray:
        """Gravity torques (N, J)."""
        qs = self._full_q(q)
        return np.array(
            [pin.computeGeneralizedGravity(self.model, self.data, row)[self._v_index] for row in qs]
        )

    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        """Joint-space inertia (N, J, J) [kg m2]."""
        index = np.ix_(self._v_index, self._v_index)
        out = np.empty((len(q), len(self._ids), len(self._ids)))
        for k, row in enumerate(self._full_q(q)):
            upper = np.triu(pin.crba(self.model, self.data, row))
            out[k] = (upper + upper.T - np.diag(np.diag(upper)))[index]
        return out

    def regressor(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        """(N, J, J, 10): torque at a joint per inertial parameter of a moving link."""
        joints = len(self._ids)
        columns = np.concatenate([np.arange(10 * (i - 1), 10 * i) for i in self._ids])
        qs, v, a = self._full_q(q), self._full_v(dq), self._full_v(ddq)
        out = np.empty((len(q), joints, joints * 10))
        for k in range(len(q)):
            y = pin.computeJointTorqueRegressor(self.model, self.data, qs[k], v[k], a[k])
            # A single row comes back flat.
            out[k] = np.atleast_2d(y)[np.ix_(self._v_index, columns)]
        return out.reshape(len(q), joints, joints, 10)

    def position_derivative(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        """(N, J, J): derivative of the inverse dynamics with respect to position [N m/rad]."""
        index = np.ix_(self._v_index, self._v_index)
        qs, v, a = self._full_q(q), self._full_v(dq), self._full_v(ddq)
        out = np.empty((len(q), len(self._ids), len(self._ids)))
        for k in range(len(q)):
            pin.computeRNEADerivatives(self.model, self.data, qs[k], v[k], a[k])
            out[k] = np.array(self.data.dtau_dq)[index]
        return out + np.diag(self.spring_stiffness)

    def base_reaction(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What the arm does to its base, and what the base does to the arm.

        Returns:
            Wrench (N, 6) of the arm on its mount at the base's origin, force then moment, base axes [N, N m];
            joint torques (6, N, J) per unit acceleration of the base, linear then angular [N m s2/m or s2].
        """
        model, data = self.model, self.data
        qs, v, a = self._full_q(q), self._full_v(dq), self._full_v(ddq)
        roots = [i for i in range(1, model.njoints) if model.parents[i] == 0]
        wrench, unit = np.empty((len(q), 6)), np.empty((6, len(q), len(self._ids)))
        zero = np.zeros(model.nv)
        kept = pin.Motion(model.gravity)
        for k in range(len(q)):
            pin.rnea(model, data, qs[k], v[k], a[k])
            total = sum((data.liMi[i].act(data.f[i]).vector for i in roots), np.zeros(6))
            wrench[k] = -total  # data.f is what the base gives to the arm
        for axis in range(6):
            model.gravity = pin.Motion(-np.eye(6)[axis])  # Pinocchio accelerates the base by -gravity
            for k in range(len(q)):
                unit[axis, k] = pin.rnea(model, data, qs[k], zero, zero)[self._v_index]
        model.gravity = kept
        return wrench, unit

    def placements(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Flange (N, 4, 4) and moving links (N, J, 4, 4) in the base at joint positions (N, J).

        All samples at once: a search over delays asks for every sample some hundred times.
        """
        q = np.asarray(q, dtype=float)
        links = np.zeros((len(q), len(self._ids), 4, 4))
        links[..., 3, 3] = 1.0
        for j in sorted(range(len(self._ids)), key=self._ids.__getitem__):  # parents first
            i = self._ids[j]
            before = self.model.jointPlacements[i].homogeneous
            if parent := self.model.parents[i]:
                before = links[:, self._ids.index(parent)] @ before
            rotation, origin = before[..., :3, :3], before[..., :3, 3]
            moved = q[:, j, None] * self.screws[j]
            links[:, j, :3, :3] = rotation @ Rotation.from_rotvec(moved[:, 3:]).as_matrix()
            links[:, j, :3, 3] = origin + (rotation @ moved[:, :3, None])[..., 0]
        return links[:, self._ids.index(self.flange_joint)] @ self.flange_in_joint.homogeneous, links

    def kinematics(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Flange (N, 4, 4) and moving links (N, J, 4, 4) in the base, and the joints' twists (N, J, 6).

        Twists are per radian, of the base's origin, translation first, in base axes.
        """
        flanges, links = self.placements(q)
        rotation = links[..., :3, :3]
        turns = (rotation @ self.screws[:, 3:, None])[..., 0]
        moves = (rotation @ self.screws[:, :3, None])[..., 0] + np.cross(links[..., :3, 3], turns)
        return flanges, links, np.concatenate([moves, turns], axis=-1)

    def _full_q(self, q: np.ndarray) -> np.ndarray:
        q = np.asarray(q, dtype=float)
        full = np.zeros((len(q), self.model.nq))
        for j, (i, continuous) in enumerate(zip(self._q_index, self._continuous, strict=True)):
            if continuous:  # Pinocchio keeps cosine and sine of an unbounded joint
                full[:, i], full[:, i + 1] = np.cos(q[:, j]), np.sin(q[:, j])
            else:
                full[:, i] = q[:, j]
        return full

    def _full_v(self, v: np.ndarray) -> np.ndarray:
        full = np.zeros((len(v), self.model.nv))
        full[:, self._v_index] = v
        return full


def add_tool(model: Any, joint: int, flange_in_joint: Any, tool: NominalTool) -> None:
    """Fix a payload to the flange of a Pinocchio model."""
    inertia = pin.Inertia(tool.mass, np.asarray(tool.center_of_mass), np.asarray(tool.inertia))
    model.inertias[joint] = model.inertias[joint] + inertia.se3Action(flange_in_joint)


def _reduced(whole: Any, locked: list[int]) -> Any:
    """The model with joints of these numbers held at zero.

    Pinocchio looks a locked joint up by the name of its frame alone, and gives up where a link has the same
    name, as ANYmal's legs do. Links have another one meanwhile.
    """
    own = {}
    for frame in whole.frames:
        if frame.type != pin.FrameType.JOINT and frame.name in whole.names:
            renamed = f"{frame.name} (link)"
            own[renamed], frame.name = frame.name, renamed
    model = pin.buildReducedModel(whole, locked, pin.neutral(whole))
    for frame in model.frames:
        frame.name = own.get(frame.name, frame.name)
    return model


def _flange(model: Any, last_joint: int) -> tuple[int, str, Any]:
    """Joint, name and placement of the last link of the unbranched chain behind the last joint."""
    bodies = [f for f in model.frames if f.type == pin.FrameType.BODY and f.parentJoint == last_joint]
    if not bodies:
        return last_joint, model.names[last_joint], pin.SE3.Identity()
    chain = bodies[0]
    while True:
        children = [
            f
            for f in bodies
            if f is not chain and model.frames[model.frames[f.parentFrame].parentFrame].name == chain.name
        ]
        if len(children) != 1:
            return last_joint, chain.name, chain.placement
        chain = children[0]


def _screw(model: Any, joint: int) -> np.ndarray:
    """Unit twist (6,) of a joint's motion in its own frame, translation first."""
    data = model.joints[joint].createData()
    model.joints[joint].calc(data, pin.neutral(model)[model.joints[joint].idx_q :][: model.joints[joint].nq])
    column = np.array(data.S).ravel()
    if column.shape != (6,):
        name = model.joints[joint].shortname()
        raise InputError(
            f"joint {model.names[joint]} is a {name}; only revolute and prismatic joints are supported"
        )
    return column


def _link_of(model: Any, joint: int) -> str:
    """The link that a joint moves."""
    for frame in model.frames:
        if frame.type == pin.FrameType.BODY and frame.parentJoint == joint:
            return frame.name
    return model.names[joint]
