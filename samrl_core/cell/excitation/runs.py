"""From what is asked for to what is played: command, controller and load of each recording."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from samrl_core.cell.excitation.clearance import ArmLine
from samrl_core.cell.excitation.excitation_trajectory import SETS, GainScale, gains, make_trajectory
from samrl_core.cell.excitation.limits import check_trajectory
from samrl_core.cell.excitation.multisine import CHIRP_HZ, multisine
from samrl_core.cell.excitation.probes import chirp, micro_reversals, static, sweep
from samrl_core.cell.excitation.slow_sweep import fastest_reversal, slow
from samrl_core.cell.excitation.task_motion import task_motion
from samrl_core.cell.excitation.trajectory_file import TrajectoryFile
from samrl_core.cell.excitation.workspace import work_box
from samrl_core.cell.robots.arm_model import Payload
from samrl_core.cell.robots.robot import ImpedanceGains, RobotSpec
from samrl_core.cell.types.arm_description import ArmController
from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.common.errors import LimitError

_DRAWS = 6


@dataclass(frozen=True, eq=False)
class Run:
    """One recording to be made."""

    name: str  # of its file, without suffix
    command: JointSignal
    controller: ArmController
    extra_mass: float = 0.0  # fixed at the payload's centre of mass before this run [kg]


def scaled_controller(spec: RobotSpec, scale: GainScale) -> ArmController:
    """The arm's controller at a share of its gains."""
    law = spec.controller
    return ArmController(
        joints=spec.joint_names,
        stiffness=scale.stiffness * law.stiffness,
        damping=scale.damping * law.damping,
        period_s=law.period_s,
        effort_limit=spec.limits.effort,
        armature=spec.armature,
    )


def with_controller(spec: RobotSpec, controller: ArmController) -> RobotSpec:
    """The arm with the gains of a run, for whatever world or driver plays it."""
    law = ImpedanceGains(controller.stiffness, controller.damping, controller.period_s)
    return replace(spec, controller=law)


def heavier(payload: Payload | None, extra_mass: float) -> Payload | None:
    """The payload with a point mass at its centre of mass."""
    if extra_mass == 0.0:
        return payload
    if payload is None:
        return Payload(extra_mass, np.zeros(3), np.zeros((3, 3)))
    return replace(payload, mass=payload.mass + extra_mass)


def set_run(letter: str, spec: RobotSpec, payload: Payload | None, seed: int, duration_s: float) -> Run:
    """Set A, B or C of an arm."""
    kind = SETS[letter]
    command = make_trajectory(spec, payload, kind, seed, duration_s, spec.controller.period_s)
    return Run(letter, command, scaled_controller(spec, gains(kind)))


def file_runs(name: str, file: TrajectoryFile, spec: RobotSpec, payload: Payload | None) -> tuple[Run, ...]:
    """The recordings that a trajectory file asks for: two for `two_gains` and `two_loads`, else one.

    Unlike the sets, nothing is made smaller to fit. Random motions are sampled again, but what breaks a limit
    each time is refused.

    Raises:
        InputError: joints that the arm has not, or parameters that do not go together.
        LimitError: joint, value and limit, where the motion would break one.
    """
    extra = file.number("extra_mass") if file.kind == "two_loads" else 0.0
    command = _allowed(file, spec, payload, extra)
    scale = GainScale(file.number("stiffness_scale"), file.number("damping_scale"))
    asked = scaled_controller(spec, scale)
    if file.kind == "two_gains":
        nominal = scaled_controller(spec, GainScale())
        return (Run(f"{name}_gains1", command, nominal), Run(f"{name}_gains2", command, asked))
    if file.kind == "two_loads":
        return (Run(f"{name}_load1", command, asked), Run(f"{name}_load2", command, asked, extra))
    return (Run(name, command, asked),)


def _allowed(file: TrajectoryFile, spec: RobotSpec, payload: Payload | None, extra: float) -> JointSignal:
    if "poses" in file.about.parameters and "speeds" in file.about.parameters:
        _check_speeds(file, spec)
    rng = np.random.default_rng(int(file.number("seed")))
    for attempt in range(_DRAWS):
        command = _command(file, spec, payload, rng)
        try:
            for load in {0.0, extra}:
                check_trajectory(spec, heavier(payload, load), command)
        except LimitError:
            if attempt == _DRAWS - 1:
                raise
            continue
        return command
    raise AssertionError("unreachable")


def _check_speeds(file: TrajectoryFile, spec: RobotSpec) -> None:
    joints = np.array(file.mask(spec.joint_names))
    top = fastest_reversal(spec, file.number("duration_s"))
    j = int(np.argmin(np.where(joints, top, np.inf)))
    for i, speed in enumerate(file.numbers("speeds")):
        if speed > top[j]:
            raise LimitError(
                f"parameters.speeds[{i}] is {speed} rad/s: {spec.joint_names[j]} may turn round at "
                f"{top[j]:.3f} rad/s at most in this time; reduce it, lengthen parameters.duration_s "
                "(up to 15 s helps), or leave that joint out"
            )


def _command(
    file: TrajectoryFile, spec: RobotSpec, payload: Payload | None, rng: np.random.Generator
) -> JointSignal:
    joints = np.array(file.mask(spec.joint_names))
    model = ArmLine(spec, payload).model
    period, duration = spec.controller.period_s, file.number("duration_s")
    box = work_box(spec, payload)
    if "amplitude" in file.about.parameters and file.about.parameters["amplitude"].unit != "rad":
        box = box.shrunk(file.number("amplitude"))
    common = (rng, duration, period)
    match file.kind:
        case "slow" | "two_loads":
            speeds, holds = file.numbers("speeds"), int(file.number("poses"))
            return slow(spec, model, box, *common, speeds=speeds, joints=joints, holds=holds)
        case "multisine" | "two_gains":
            low, high = file.numbers("band")
            return multisine(spec, box, *common, band_hz=(low, high), chirp_hz=CHIRP_HZ, joints=joints)
        case "task":
            return task_motion(spec, box, *common, joints=joints)
        case "static":
            return static(spec, model, box, *common, joints=joints, poses=int(file.number("poses")))
        case "chirp":
            low, high = file.numbers("band")
            return chirp(spec, box, duration, period, joints, (low, high), file.number("speed"))
        case "micro_reversals":
            size, speed, poses = file.number("amplitude"), file.number("speed"), int(file.number("poses"))
            return micro_reversals(
                spec, model, box, *common, joints=joints, amplitude=size, speed=speed, poses=poses
            )
        case "sweep":
            return sweep(spec, box, *common, joints, file.numbers("speeds"), file.number("amplitude"))
    raise AssertionError(file.kind)
