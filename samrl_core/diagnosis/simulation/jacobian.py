"""Jacobian of rollouts with respect to chosen parameters: differences, all plants in one batch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.simulation.closed_loop import ClosedLoop, Rollouts
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters, joint_fields

# (name, place): a joint's index for joint fields, start_position and start_velocity; (joint, 0..9) for
# inertial_delta; an index for payload and gravity; None for fields of the mount.
Parameter = tuple[str, int | tuple[int, int] | None]

RELATIVE = 1e-5  # of the larger of the value and its scale: truncation and rounding both below 1e-6
SCALES = {"rad": 0.02, "N m": 1.0, "s": 0.05, "1/rev": 1.0, "N m/rad": 100.0, "kg m2": 0.1, "Hz": 10.0}
_DELAYS = ("command_delay", "effort_delay")
_PARTS = {
    "joint_stiffness": np.inf,
    "command_cutoff": np.inf,
    "effort_cutoff": np.inf,
    "presliding_stiffness": 0.0,
}
_NEVER = ("encoder_resolution", "hold_probability")


@dataclass(frozen=True, eq=False)
class Jacobian:
    """Derivatives (P, T, J) of each channel with respect to P parameters, around `rollouts` (B = 1)."""

    wrt: tuple[Parameter, ...]
    rollouts: Rollouts
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray
    commanded_effort: np.ndarray


def jacobian(
    loop: ClosedLoop,
    command: JointSignal,
    start_position: np.ndarray,
    start_velocity: np.ndarray,
    plant: PlantParameters,
    duration_s: float,
    wrt: Sequence[Parameter],
    *,
    record_every: int = 1,
) -> Jacobian:
    """Central differences (forward ones at a bound) of one plant's rollout.

    Raises:
        InputError: an unknown parameter, a place it does not have, or one without derivative there (a part
            that is absent, such as an infinite joint stiffness: start from a finite value).
        DivergenceError: a plant that is unstable.
    """
    start_q = loop.model.start_values("start_position", start_position, 1)[0]
    start_v = loop.model.start_values("start_velocity", start_velocity, 1)[0]
    plants, qs, vs, rows = [plant], [start_q], [start_v], []
    for parameter in wrt:
        value, step, low = _step(loop, plant, parameter)
        back = step if value - step >= low else 0.0
        for change in (step, -back):
            if change != 0.0:
                moved, q, v = _moved(loop, plant, start_q, start_v, parameter, change)
                plants.append(moved)
                qs.append(q)
                vs.append(v)
        rows.append((len(plants) - (2 if back else 1), len(plants) - 1 if back else 0, step + back))
    run = loop.rollout(
        command, np.array(qs), np.array(vs), plants, duration_s, record_every=record_every
    )  # fmt: skip
    channels = []
    for values in (run.position, run.velocity, run.effort, run.commanded_effort):
        parts = [(values[ahead] - values[behind]) / width for ahead, behind, width in rows]
        channels.append(np.array(parts).reshape(len(wrt), *values.shape[1:]))
    first = Rollouts(run.time, run.position[:1], run.velocity[:1], run.effort[:1], run.commanded_effort[:1])
    return Jacobian(tuple(wrt), first, *channels)


def _step(loop: ClosedLoop, plant: PlantParameters, parameter: Parameter) -> tuple[float, float, float]:
    """Present value, step and lower bound."""
    name, place = parameter
    table = joint_fields()
    joints = len(loop.arm.joints)
    if name in table and name not in _NEVER:
        value = float(plant.joint_values(name, joints)[_index(parameter, joints)])
        if (
            name == "backlash"
            and value == 0
            and np.isinf(plant.joint_values("joint_stiffness", joints)[place])
        ):
            raise InputError(
                f"backlash of joint {place} is 0 and the joint rigid: no derivative there; start above 0"
            )
        if name in _PARTS and value == _PARTS[name]:
            raise InputError(
                f"{name} of joint {place} is {value}: that part is absent; start from another value"
            )
        if name in _DELAYS:  # piecewise linear: any step within a period does, a large one rounds least
            return value, 0.02 * loop.model.step_s, 0.0
        scale = SCALES.get(table[name]["unit"], 0.1)
        if name == "coulomb_velocity":
            scale = 0.0
        low = -float(loop.model.armature[place]) if name == "rotor_inertia" else table[name]["low"]
        return value, RELATIVE * max(abs(value), scale), low
    if name == "inertial_delta":
        if not (isinstance(place, tuple) and 0 <= place[0] < joints and 0 <= place[1] < 10):
            raise InputError(f"inertial_delta needs a place (joint, 0..9), not {place}")
        return 0.0, RELATIVE, -np.inf
    if name in ("payload", "gravity", "start_position", "start_velocity"):
        _index(parameter, {"payload": 10, "gravity": 3}.get(name, joints))
        return 0.0, RELATIVE, -np.inf
    if name in ("mount_stiffness", "mount_damping", "mount_inertia"):
        if np.isinf(plant.mount_stiffness):
            raise InputError(f"{name}: the mount is rigid; start from a finite mount_stiffness")
        value = float(getattr(plant, name))
        return value, RELATIVE * max(value, 1.0), 0.0
    known = sorted(
        {*table, "inertial_delta", "payload", "gravity", "start_position", "start_velocity"} - {*_NEVER}
    )
    raise InputError(f"no derivative with respect to '{name}'; known are {known} and those of the mount")


def _index(parameter: Parameter, size: int) -> int:
    name, place = parameter
    if not isinstance(place, int | np.integer) or not 0 <= place < size:
        raise InputError(f"{name} needs an index 0..{size - 1}, not {place}")
    return int(place)


def _moved(
    loop: ClosedLoop,
    plant: PlantParameters,
    start_q: np.ndarray,
    start_v: np.ndarray,
    parameter: Parameter,
    change: float,
) -> tuple[PlantParameters, np.ndarray, np.ndarray]:
    name, place = parameter
    joints = len(loop.arm.joints)
    if name in ("start_position", "start_velocity"):
        moved = (start_q if name == "start_position" else start_v).copy()
        moved[place] += change
        return (plant, moved, start_v) if name == "start_position" else (plant, start_q, moved)
    if name.startswith("mount_"):
        values: object = getattr(plant, name) + change
    else:
        if name == "inertial_delta":
            array = (
                np.zeros((joints, 10))
                if plant.inertial_delta is None
                else np.array(plant.inertial_delta, float)
            )
        elif name == "payload":
            array = np.zeros(10) if plant.payload is None else np.array(plant.payload, dtype=float)
        elif name == "gravity":
            array = np.array(loop.model.gravity if plant.gravity is None else plant.gravity, dtype=float)
        else:
            array = plant.joint_values(name, joints).copy()
        array[place] += change
        values = array
    return replace(plant, **{name: values}), start_q, start_v
