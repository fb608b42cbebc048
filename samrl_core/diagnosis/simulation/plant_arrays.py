"""From plants to the numbers that the kernels read, and derivatives on the same way back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from samrl_core.cell.robots.joint_dynamics import JointDynamics
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters, joint_fields
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from samrl_core.diagnosis.simulation.simulation_arrays import F, P

# ASSUMPTION: stiffness of the teeth behind a backlash where no elasticity is stated; winds up 2 mrad at the
# effort limit, stiffer than any gear of the catalogue.
TEETH_PER_EFFORT = 500.0  # [1/rad]
MOST_DAMPING = 1.5  # damping x step / rotor inertia up to which an elastic joint's motor moves apart
FREE_EFFORT = 20.0  # effort limit assumed for it where the URDF states none [N m]

_SLOTS = {name: P[name.upper()] for name in joint_fields() if name.upper() in P.__members__}
_DELAYS = {"command_delay": P.COMMAND_DELAY, "effort_delay": P.EFFORT_DELAY}
_CUTOFFS = {"command_cutoff": P.COMMAND_ALPHA, "effort_cutoff": P.EFFORT_ALPHA}
_NO_DERIVATIVE = ("encoder_resolution", "hold_probability")


@dataclass(frozen=True, eq=False)
class PlantArrays:
    """Plants (B) as arrays; joints in the tree's order, the mount's two first where there is one."""

    params: np.ndarray  # (B, n, len(P))
    flags: np.ndarray  # (B, n) int32
    inertia: np.ndarray  # (B, n, 10)
    gravity: np.ndarray  # (B, 3)
    seed: np.ndarray  # (B,) int32


def pack(
    plants: Sequence[PlantParameters],
    rigid: RigidArm,
    order: np.ndarray,
    nominal: JointDynamics,
    damping: np.ndarray,
    teeth: np.ndarray,
    nominal_gravity: np.ndarray,
    step_s: float,
    mount: int,
    everything: bool,
) -> PlantArrays:
    """Arrays of some plants.

    Args:
        plants: all of them with a mount, or none.
        rigid: the nominal arm.
        order: (J,) index in the description's order of each joint of the tree.
        nominal: friction, damping and rotor inertia that the plants' own are added to.
        damping: (J,) of the controller, description's order.
        teeth: (J,) stiffness behind a backlash, description's order.
        nominal_gravity: (3,), for plants that state none.
        step_s: integration step.
        mount: 2 or 0 joints before the arm's own.
        everything: compute also the parts that are neutral, for their derivatives.

    Raises:
        InputError: arrays that do not fit the arm's joints.
    """
    joints = len(order)
    n = joints + mount
    params = np.zeros((len(plants), n, len(P)))
    flags = np.zeros((len(plants), n), dtype=np.int32)
    inertia = np.zeros((len(plants), n, 10))
    gravity = np.zeros((len(plants), 3))
    bodies = rigid.inertial_parameters
    to_joint = ten_to_frame(rigid.flange_in_joint.rotation, rigid.flange_in_joint.translation)
    for b, plant in enumerate(plants):
        values = {name: plant.joint_values(name, joints) for name in joint_fields()}
        values["rotor_inertia"] = values["rotor_inertia"] + nominal.armature
        values["coulomb"] = values["coulomb"] + nominal.friction
        values["viscous"] = values["viscous"] + nominal.damping
        values["cable_stiffness"], values["cable_rest"] = _springs(plant, rigid)
        if (low := values["rotor_inertia"]).min() < 0:
            raise InputError(f"rotor inertia {low} kg m2, nominal armature included, must not be negative")
        slack = values["backlash"] > 0
        rigid_slack = slack & np.isinf(values["joint_stiffness"])
        values["joint_stiffness"] = np.where(rigid_slack, teeth, values["joint_stiffness"])
        # A sampled damper of the controller throws a rotor lighter than half of this back and forth.
        apart = values["rotor_inertia"] * MOST_DAMPING >= np.maximum(
            damping * values["damping_scale"] * step_s, 1e-9
        )
        flags[b, mount:] = _flags(plant, values, apart, everything)[order]
        values["joint_stiffness"] = np.where(
            np.isinf(values["joint_stiffness"]), 0.0, values["joint_stiffness"]
        )
        values["actuator_gain"] = 1.0 + values["actuator_gain"]
        for name, slot in _SLOTS.items():
            params[b, mount:, slot] = values[name][order]
        for name, slot in _DELAYS.items():
            params[b, mount:, slot] = values[name][order] / step_s
        for name, slot in _CUTOFFS.items():
            params[b, mount:, slot] = 1.0 - np.exp(-2.0 * np.pi * step_s * values[name][order])
        if mount:
            flags[b, :mount] = int(F.PASSIVE)
            params[b, :mount, P.JOINT_STIFFNESS] = plant.mount_stiffness
            params[b, :mount, P.JOINT_DAMPING] = plant.mount_damping
            params[b, :mount, P.ROTOR_INERTIA] = plant.mount_inertia
        ten = bodies.copy()
        if plant.inertial_delta is not None:
            delta = np.asarray(plant.inertial_delta, dtype=float)
            if delta.shape != (joints, 10):
                raise InputError(f"inertial_delta has shape {delta.shape}; it must be ({joints}, 10)")
            ten = ten + delta
        if plant.payload is not None:
            ten[-1] = ten[-1] + to_joint @ np.asarray(plant.payload, dtype=float)
        inertia[b, mount:] = ten[order]
        gravity[b] = nominal_gravity if plant.gravity is None else plant.gravity
    seeds = np.array([plant.seed for plant in plants], dtype=np.int32)
    return PlantArrays(params, flags, inertia, gravity, seeds)


def unpack_gradient(
    params: np.ndarray,
    inertia: np.ndarray,
    gravity: np.ndarray,
    plant: PlantParameters,
    rigid: RigidArm,
    order: np.ndarray,
    step_s: float,
    mount: int,
) -> dict[str, np.ndarray]:
    """Derivatives with respect to one plant's fields from those with respect to its arrays."""
    joints = len(order)
    out: dict[str, np.ndarray] = {}

    def arm_order(values: np.ndarray) -> np.ndarray:
        result = np.zeros_like(values)
        result[order] = values
        return result

    for name, slot in _SLOTS.items():
        if name not in _NO_DERIVATIVE:
            out[name] = arm_order(params[mount:, slot])
    for name, slot in _DELAYS.items():
        out[name] = arm_order(params[mount:, slot]) / step_s
    for name, slot in _CUTOFFS.items():
        cutoff = plant.joint_values(name, joints)
        rate = 2.0 * np.pi * step_s
        out[name] = arm_order(params[mount:, slot]) * rate * np.exp(-rate * cutoff)
    total, rest = _springs(plant, rigid)
    share = np.divide(out["cable_rest"], total, out=np.zeros(joints), where=total != 0)
    cable = plant.joint_values("cable_stiffness", joints)
    out["cable_stiffness"] += share * (plant.joint_values("cable_rest", joints) - rest)
    out["cable_rest"] = np.where(rigid.spring_stiffness != 0, share * cable, out["cable_rest"])
    out["inertial_delta"] = arm_order(inertia[mount:])
    to_joint = ten_to_frame(rigid.flange_in_joint.rotation, rigid.flange_in_joint.translation)
    out["payload"] = to_joint.T @ out["inertial_delta"][-1]
    out["gravity"] = gravity.copy()
    for name, slot in (
        ("mount_stiffness", P.JOINT_STIFFNESS),
        ("mount_damping", P.JOINT_DAMPING),
        ("mount_inertia", P.ROTOR_INERTIA),
    ):
        out[name] = np.asarray(params[:mount, slot].sum())
    return out


def _springs(plant: PlantParameters, rigid: RigidArm) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and rest (J,) of the one spring that a plant's cable and the stated spring make together."""
    joints = len(rigid.joints)
    cable, rest = plant.joint_values("cable_stiffness", joints), plant.joint_values("cable_rest", joints)
    total = cable + rigid.spring_stiffness
    moment = cable * rest + rigid.spring_stiffness * rigid.spring_rest
    together = (rigid.spring_stiffness != 0) & (total != 0)
    return total, np.where(together, moment / np.where(together, total, 1.0), rest)


def ten_to_frame(rotation: np.ndarray, translation: np.ndarray) -> np.ndarray:
    """(10, 10) map of [m, m c, I] about a frame to the same about the frame that it is placed in."""
    columns = []
    for unit in np.eye(10):
        moment = rotation @ unit[1:4]
        xx, xy, yy, xz, yz, zz = unit[4:]
        inertia = rotation @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ rotation.T
        p, m = translation, unit[0]
        cross = np.outer(p, moment) + np.outer(moment, p) + m * np.outer(p, p)
        inertia = inertia + np.trace(cross) * np.eye(3) - cross
        moment = moment + m * p
        low = [inertia[0, 0], inertia[0, 1], inertia[1, 1], inertia[0, 2], inertia[1, 2], inertia[2, 2]]
        columns.append([m, *moment, *low])
    return np.array(columns).T


def _flags(
    plant: PlantParameters, values: dict[str, np.ndarray], apart: np.ndarray, everything: bool
) -> np.ndarray:
    def bit(flag: F, on: np.ndarray) -> np.ndarray:
        return np.where(on, int(flag), 0)

    drop, wave = values["stribeck_drop"] != 0, values["friction_harmonic_amplitude"] != 0
    bristle = values["presliding_stiffness"] > 0
    parts = ("coulomb", "viscous", "load_friction", "friction_asymmetry")
    rubs = drop | wave | bristle | np.any([values[name] != 0 for name in parts], axis=0)
    structure = (
        bit(F.ELASTIC, np.isfinite(values["joint_stiffness"]) & apart)
        + bit(F.QUASI, np.isfinite(values["joint_stiffness"]) & ~apart)
        + bit(F.BRISTLE, bristle)
        + bit(F.QUANTISED, values["encoder_resolution"] > 0)
        + bit(F.HOLD, values["hold_probability"] > 0)
        + (int(F.READ_LINK) if plant.reading == "link" else 0)
    )
    optional = (
        (F.ENCODER_WAVE, values["encoder_amplitude"] != 0),
        (F.FRICTION, rubs),
        (F.STRIBECK, drop),
        (F.FRICTION_WAVE, wave),
        (F.THERMAL, rubs & (values["thermal_ratio"] != 0)),
        (F.TORQUE_WAVE, values["harmonic_amplitude"] != 0),
        (F.HYSTERESIS, values["hysteresis_amplitude"] != 0),
        (F.CABLE, (values["cable_stiffness"] != 0) | (values["cable_friction"] != 0)),
        (F.DELAYED, values["effort_delay"] > 0),
    )
    return structure + sum(bit(flag, np.full(on.shape, True) if everything else on) for flag, on in optional)
