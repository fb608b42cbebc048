"""What a closed loop is made of: the arm, its controller's numbers per joint, the integration step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.cell.robots.joint_dynamics import joint_dynamics
from samrl_core.cell.types.arm_description import ArmController, ArmDescription
from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.cell.types.drive_law import PER_JOINT
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.simulation.plant_arrays import FREE_EFFORT, TEETH_PER_EFFORT
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from samrl_core.diagnosis.simulation.simulation_arrays import L
from samrl_core.diagnosis.simulation.tree import JointTree

LONGEST_STEP_S = 0.002  # of integration
FIELD_STEP_S = 0.00025  # of the same where a stepper's poles make a stiff spring


class LoopModel:
    """A described arm under its described controller, as `ClosedLoop` simulates it.

    An effort of sample k acts over the period that starts at k (`efforts="start"`), or over the one that
    ends there, as a driver publishes it that reports what it has just applied (`efforts="end"`; the first
    sample is then the torque that holds the arm).

    Raises:
        InputError: a description without URDF or controller, or gains that do not fit its joints.
    """

    def __init__(
        self,
        arm: ArmDescription,
        device: str = "cpu",
        *,
        substeps: int | None = None,
        efforts: str = "start",
        threads: int = 1,
    ) -> None:
        """Read the URDF.

        `substeps` are integration steps to a period, as many as needed where left out; plants are spread
        over `threads`.
        """
        if substeps is None:
            substeps = 1 if arm.controller is None else usual_substeps(arm.controller)
        if arm.controller is None:
            raise InputError(f"{arm.role} has no controller; a closed loop needs one")
        if substeps < 1 or threads < 1 or efforts not in ("start", "end"):
            raise InputError(
                f"substeps {substeps} and threads {threads} must be at least 1; "
                f"efforts '{efforts}' must be 'start' or 'end'"
            )
        self.arm = arm
        self.rigid = RigidArm(arm)
        self.device = device
        self.substeps, self.threads = substeps, threads
        self.shift = 0 if efforts == "start" else substeps
        self.step_s = arm.controller.period_s / substeps
        joints = len(arm.joints)
        control = arm.controller
        if control.joints != arm.joints:
            raise InputError(
                f"the controller drives {control.joints}, the arm has {arm.joints}; list the same joints"
            )
        limits = self.rigid.effort_limits() if control.effort_limit is None else control.effort_limit
        self.effort_limit = _per_joint("effort limit", limits, joints)
        self.stiffness = _per_joint("stiffness", control.stiffness, joints)
        self.damping = _per_joint("damping", control.damping, joints)
        self.joint_dynamics = joint_dynamics(arm)
        self.armature = _per_joint("armature", self.joint_dynamics.armature, joints)
        slots = [(L[name.upper()], name) for name in PER_JOINT if name.upper() in L.__members__]
        self.law = np.zeros((joints, len(L)))
        for slot, name in slots:
            self.law[:, slot] = control.law.of_joints(name, joints)
        self.reading = control.law.encoder
        self.gravity = np.asarray(control.gravity, dtype=float)
        limits = np.where(np.isfinite(self.effort_limit), self.effort_limit, FREE_EFFORT)
        self.teeth = TEETH_PER_EFFORT * limits
        self.hints: dict[int, np.ndarray] = {}  # inertia each joint feels, per tree; filled on first use
        self.trees = {mount: JointTree(self.rigid, mount) for mount in (0, 2)}

    def groups(self, plants: Sequence[PlantParameters]) -> list[tuple[list[int], int]]:
        """Indices of the plants that share a tree, and the number of joints of their mount."""
        if len(plants) == 0:
            raise InputError("no plants to simulate; pass at least PlantParameters()")
        rigid = [i for i, plant in enumerate(plants) if np.isinf(plant.mount_stiffness)]
        swinging = [i for i, plant in enumerate(plants) if np.isfinite(plant.mount_stiffness)]
        return [(members, mount) for members, mount in ((rigid, 0), (swinging, 2)) if members]

    def steps(self, duration_s: float) -> int:
        """Integration steps, the one that starts at the last sample included."""
        if not (np.isfinite(duration_s) and duration_s >= 0):
            raise InputError(f"duration is {duration_s} s; it must be finite and not negative")
        return int(np.floor(duration_s / (self.step_s * self.substeps) + 1e-6)) * self.substeps + 1

    def joint_name(self, plant: PlantParameters, joint: int) -> str:
        """Name of a joint of the tree."""
        mount = 0 if np.isinf(plant.mount_stiffness) else 2
        return (
            ("mount x", "mount y")[joint]
            if joint < mount
            else self.arm.joints[self.trees[0].order[joint - mount]]
        )

    def commands(self, command: JointSignal, steps: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Position, velocity and feed-forward (steps, J) at every integration step, description's order."""
        if command.position is None:
            raise InputError("the command has no positions; the controller needs them")
        time = np.arange(steps) * self.step_s
        shape = (steps, len(self.arm.joints))
        position = sampled("command", command.time, command.position, time, shape[1])
        velocity, effort = (
            np.zeros(shape) if values is None else sampled("command", command.time, values, time, shape[1])
            for values in (command.velocity, command.effort)
        )
        return position, velocity, effort

    def enabled(self, flags: JointSignal | None, steps: int) -> np.ndarray:
        """Share of its torque (steps, J) that each drive gives; one row where none is ever switched off."""
        joints = len(self.arm.joints)
        if flags is None or flags.effort is None or not len(flags):
            return np.ones((1, joints))
        if flags.effort.shape != (len(flags), joints):
            raise InputError(f"torque_enabled has shape {flags.effort.shape}; it must be (N, {joints})")
        time = np.arange(steps) * self.step_s
        index = np.clip(np.searchsorted(flags.time, time + 1e-9, side="right") - 1, 0, len(flags) - 1)
        return (flags.effort[index] > 0).astype(float)

    def start_values(self, name: str, values: np.ndarray, plants: int) -> np.ndarray:
        """Checked start (B, J) of all plants."""
        array = np.asarray(values, dtype=float)
        joints = len(self.arm.joints)
        if array.shape not in ((joints,), (plants, joints)):
            raise InputError(
                f"{name} has shape {array.shape}; it must be ({joints},) or ({plants}, {joints})"
            )
        if not np.isfinite(array).all():
            raise InputError(f"{name} has values that are not finite: {array}")
        return np.broadcast_to(array, (plants, joints)).copy()


def usual_substeps(controller: ArmController) -> int:
    """Integration steps to a period: servos think slowly, and a magnetic field does not wait at all."""
    longest = FIELD_STEP_S if np.any(np.asarray(controller.law.pole_pitch) > 0) else LONGEST_STEP_S
    return max(1, int(np.ceil(controller.period_s / longest - 1e-9)))


def _per_joint(name: str, values: object, joints: int) -> np.ndarray:
    array = np.asarray(values, dtype=float)
    if array.shape not in ((), (joints,)) or np.isnan(array).any() or (array < 0).any():
        raise InputError(f"controller's {name} is {values}; it must be ({joints},) and not negative")
    return np.broadcast_to(array, (joints,)).astype(float)


def sampled(name: str, time: np.ndarray, values: np.ndarray, at: np.ndarray, joints: int) -> np.ndarray:
    """Linear interpolation of (N, J) at other times; held before the first and after the last stamp.

    Raises:
        InputError: wrong shape, stamps that do not increase, values that are not finite.
    """
    time, values = np.asarray(time, dtype=float), np.asarray(values, dtype=float)
    if time.ndim != 1 or len(time) == 0 or values.shape != (len(time), joints):
        raise InputError(
            f"{name}: stamps {time.shape} and values {values.shape} must be (N,) and (N, {joints})"
        )
    if not (np.isfinite(time).all() and np.isfinite(values).all()):
        raise InputError(f"{name}: stamps or values are not finite")
    if (np.diff(time) <= 0).any():
        raise InputError(
            f"{name}: stamps must increase; they do not after {time[:-1][np.diff(time) <= 0][0]} s"
        )
    left, share = interpolation(time, at)
    right = np.minimum(left + 1, len(time) - 1)
    return values[left] + (values[right] - values[left]) * share[:, None]


def interpolation(time: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For each wanted time the sample before it and the share of the next one in the value there."""
    if len(time) == 1:
        return np.zeros(len(at), dtype=int), np.zeros(len(at))
    left = np.clip(np.searchsorted(time, at, side="right"), 1, len(time) - 1) - 1
    return left, np.clip((at - time[left]) / (time[left + 1] - time[left]), 0.0, 1.0)
