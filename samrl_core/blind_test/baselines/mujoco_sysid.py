"""MuJoCo's own system identification; named is what its 95 % interval holds apart from nominal."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable, Sequence
from typing import Any
from xml.etree import ElementTree

import mujoco as mujoco_module
import numpy as np

from samrl_core.blind_test.baselines.claim import NOTHING, Claim
from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm

mujoco: Any = mujoco_module  # its compiled names have no stubs

TIMESTEP = 0.001  # [s]
PIECE_S, PIECES = 2.0, 2  # length of a rollout [s], rollouts per recording: open-ended ones drift away
ITERATIONS = 6
OFFSET = 0.01  # bound of a drive's torque offset, fraction of the effort limit; fitted, never named
FRICTION, DAMPING, ARMATURE, GAIN, MASS, PAYLOAD = 1.5, 2.0, 0.1, 0.1, 0.2, 1.0  # upper ends of the ranges
NOTHING_HELD = 1e-6  # mass [kg] and inertia [kg m2] of a tool where none is described


def mujoco_sysid(fit: Sequence[ArmRecording]) -> Claim:
    """Friction, damping, rotor inertia, drive gain, offset and mass of all joints and links, and payload.

    Rollouts in closed loop with the described controller, position and velocity compared, least squares and
    intervals by `mujoco.sysid` (MuJoCo 4.0, extra `sysid`).

    Raises:
        InputError: the extra is not installed, or a recording has no URDF, controller or command.
    """
    sysid = _sysid()
    arm = fit[0].arm
    spec = _spec(arm)
    parameters, meaning = _parameters(sysid, arm, spec)
    names, states, controls, sensors = [], [], [], []
    model = spec.compile()
    for recording in fit:
        for k, (state, control, sensor) in enumerate(_pieces(sysid, model, recording)):
            names.append(f"{len(names)}_{k}")
            states.append(state)
            controls.append(control)
            sensors.append(sensor)
    sequences = sysid.ModelSequences("arm", spec, names, states, controls, sensors)
    residual = sysid.build_residual_fn(models_sequences=[sequences], n_threads=1)
    with contextlib.redirect_stdout(io.StringIO()):  # it prints its iterations whatever its settings
        found, result = sysid.optimize(
            parameters, residual, optimizer="mujoco", verbose=False, max_iters=ITERATIONS
        )
    x = found.as_vector()
    remainder, _, _ = residual(x, found)
    _, half = sysid.calculate_intervals(remainder, np.asarray(result.jac))
    return _named(x, parameters.as_nominal_vector(), np.asarray(half), meaning)


def _named(
    x: np.ndarray, nominal: np.ndarray, half: np.ndarray, meaning: list[tuple[str, str, float]]
) -> Claim:
    """Largest deviation over range among those whose interval excludes the nominal value."""
    best = NOTHING
    for value, zero, width, (family, place, span) in zip(x, nominal, half, meaning, strict=True):
        if not family:
            continue
        size = abs(value - zero) / span
        if abs(value - zero) > width and size > best.score:
            best = Claim(family, place, float(size))
    return best


def _sysid() -> Any:
    from mujoco import sysid

    if not hasattr(sysid, "optimize"):
        raise InputError("mujoco.sysid lacks its dependencies: pip install 'mujoco[sysid]==4.0.0'")
    return sysid


def _spec(arm: ArmDescription) -> Any:
    """The nominal arm with the described controller as actuators; gravity is compensated as described."""
    if arm.urdf is None or arm.controller is None:
        raise InputError(f"{arm.role} has no URDF or no controller; mujoco_sysid needs both")
    root = ElementTree.fromstring(arm.urdf)
    for link in root.iter("link"):
        for part in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(part)
    extension = ElementTree.SubElement(root, "mujoco")
    ElementTree.SubElement(extension, "compiler", fusestatic="false", balanceinertia="true")
    spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
    spec.option.timestep = TIMESTEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER  # the described law is explicit
    spec.option.gravity = np.asarray(arm.controller.gravity, float)
    tool = spec.body(RigidArm(arm).flange).add_body(name="samrl_tool")
    tool.explicitinertial = True
    tool.mass = arm.tool.mass if arm.tool is not None else NOTHING_HELD
    tool.ipos = arm.tool.center_of_mass if arm.tool is not None else np.zeros(3)
    inertia = np.asarray(arm.tool.inertia, float) if arm.tool is not None else NOTHING_HELD * np.eye(3)
    tool.fullinertia = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    compensated = 1.0 if arm.controller.gravity_compensation else 0.0
    for body in spec.bodies:
        body.gravcomp = compensated
    armature = arm.controller.armature if arm.controller.armature is not None else np.zeros(len(arm.joints))
    for k, name in enumerate(arm.joints):
        joint = spec.joint(name)
        _set(joint, "armature", float(armature[k]))
        _set(joint, "damping", 0.0)
        _set(joint, "frictionloss", 0.0)
        joint.limited = mujoco.mjtLimited.mjLIMITED_FALSE
        stiffness, damping = float(arm.controller.stiffness[k]), float(arm.controller.damping[k])
        actuator = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        actuator.gaintype, actuator.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
        actuator.gainprm[0] = stiffness
        actuator.biasprm[:3] = [0.0, -stiffness, -damping]
    for kind, suffix in (
        (mujoco.mjtSensor.mjSENS_JOINTPOS, "pos"),
        (mujoco.mjtSensor.mjSENS_JOINTVEL, "vel"),
    ):
        for name in arm.joints:
            spec.add_sensor(
                name=f"{name}_{suffix}", type=kind, objtype=mujoco.mjtObj.mjOBJ_JOINT, objname=name
            )
    return spec


def _parameters(sysid: Any, arm: ArmDescription, spec: Any) -> tuple[Any, list[tuple[str, str, float]]]:
    """The parameters, and what each stands for: family (empty: none), place, range.

    The toolbox applies them to the same spec again and again, so each sets a value and none changes one.
    """
    controller = arm.controller
    if controller is None:
        raise InputError(f"{arm.role} has no controller")
    armature = controller.armature if controller.armature is not None else np.zeros(len(arm.joints))
    limits = controller.effort_limit if controller.effort_limit is not None else RigidArm(arm).effort_limits()
    parameters, meaning = sysid.ParameterDict(), []

    def add(name: str, low: float, nominal: float, high: float, apply: Callable[[Any, float], None],
            family: str, place: str, span: float) -> None:  # fmt: skip
        parameters.add(
            sysid.Parameter(name, nominal, low, high, modifier=lambda spec, p: apply(spec, float(p.value[0])))
        )
        meaning.append((family, place, span))

    for k, joint in enumerate(arm.joints):
        at = f"joint:{joint}"
        rotor, stiffness, drag = (
            float(armature[k]),
            float(controller.stiffness[k]),
            float(controller.damping[k]),
        )

        def friction(spec: Any, value: float, joint: str = joint) -> None:
            _set(spec.joint(joint), "frictionloss", value)

        def damping(spec: Any, value: float, joint: str = joint) -> None:
            _set(spec.joint(joint), "damping", value)

        def inertia(spec: Any, value: float, joint: str = joint) -> None:
            _set(spec.joint(joint), "armature", value)

        def gain(spec: Any, value: float, joint: str = joint, k: float = stiffness, d: float = drag) -> None:
            actuator = spec.actuator(joint)
            actuator.gainprm[0] = k * (1 + value)
            actuator.biasprm[1], actuator.biasprm[2] = -k * (1 + value), -d * (1 + value)

        def offset(spec: Any, value: float, joint: str = joint) -> None:
            spec.actuator(joint).biasprm[0] = value

        most = OFFSET * float(limits[k])
        add(f"offset_{joint}", -most, 0.0, most, offset, "", at, most)
        add(f"friction_{joint}", 0.0, 0.0, 2 * FRICTION, friction, "coulomb_friction", at, FRICTION)
        add(f"damping_{joint}", 0.0, 0.0, 2 * DAMPING, damping, "viscous_friction", at, DAMPING)
        add(f"armature_{joint}", 0.0, rotor, rotor + 2 * ARMATURE, inertia, "reflected_inertia", at, ARMATURE)
        add(f"gain_{joint}", -2 * GAIN, 0.0, 2 * GAIN, gain, "actuator_gain", at, GAIN)
    compensated = 1.0 if controller.gravity_compensation else 0.0

    def weigh(body: Any, nominal: float, added: float) -> None:
        """More mass, compensated as if it were the nominal one: the controller does not know of it."""
        body.mass = nominal + added
        body.gravcomp = compensated * nominal / (nominal + added)

    for link in RigidArm(arm).links:
        known = float(spec.body(link).mass)

        def mass(spec: Any, value: float, link: str = link, known: float = known) -> None:
            weigh(spec.body(link), known, known * value)

        add(f"mass_{link}", -2 * MASS, 0.0, 2 * MASS, mass, "link_inertia", f"link:{link}", MASS)

    held = float(spec.body("samrl_tool").mass)

    def payload(spec: Any, value: float) -> None:
        weigh(spec.body("samrl_tool"), held, value)

    add("payload", -0.5 * held, 0.0, 2 * PAYLOAD, payload, "payload", f"arm:{arm.role}", PAYLOAD)
    return parameters, meaning


def _set(joint: Any, field: str, value: float) -> None:
    """Joint damping has become a polynomial in MuJoCo 4: its first coefficient is meant."""
    if np.ndim(getattr(joint, field)):
        getattr(joint, field)[0] = value
    else:
        setattr(joint, field, value)


def _pieces(sysid: Any, model: Any, recording: ArmRecording) -> list[tuple[np.ndarray, Any, Any]]:
    """Initial state, control and measurement of pieces spread over a recording."""
    arm, states, command = recording.arm, recording.states, recording.command
    if arm.controller is None or command is None or command.position is None:
        raise InputError(f"{recording.name} has no controller or no command; mujoco_sysid needs both")
    if states.position is None or states.velocity is None:
        raise InputError(f"{recording.name} lacks position or velocity")
    still = np.zeros_like(command.position)
    velocity = command.velocity if command.velocity is not None else still
    forward = command.effort if command.effort is not None else still
    control = command.position + (arm.controller.damping * velocity + forward) / arm.controller.stiffness
    steps = int(PIECE_S / TIMESTEP)
    first, last = states.time[0] + 0.2, states.time[-1] - PIECE_S - 0.2
    order = [model.actuator(name).id for name in arm.joints]
    ahead = 0.5 * (
        TIMESTEP - arm.controller.period_s
    )  # a longer hold of the command lags by half the difference
    pieces = []
    for start in np.linspace(first, max(first, last), PIECES):
        time = start + TIMESTEP * np.arange(steps)
        q, dq = _at(time, states.time, states.position), _at(time, states.time, states.velocity)
        place = np.zeros(model.nq)
        speed = np.zeros(model.nv)
        for k, name in enumerate(arm.joints):
            place[model.joint(name).qposadr[0]], speed[model.joint(name).dofadr[0]] = q[0, k], dq[0, k]
        u = np.zeros((steps, model.nu))
        u[:, order] = _at(time + ahead, command.time, control)
        local = TIMESTEP * np.arange(steps)
        # MuJoCo's sensors show the state before a step, but the toolbox stamps them with its end.
        measured = sysid.TimeSeries.from_names(local + TIMESTEP, np.concatenate([q, dq], axis=1), model)
        pieces.append((sysid.create_initial_state(model, place, speed), sysid.TimeSeries(local, u), measured))
    return pieces


def _at(time: np.ndarray, known: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.stack([np.interp(time, known, column) for column in values.T], axis=1)
