"""Torque residuals of the nominal model, filtered and decimated: the input of the regression baselines."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, lfilter, sosfiltfilt

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm

CUTOFF_HZ = 15.0  # zero-phase low-pass on every channel alike (10 Hz is usual for logs of a real Panda)
RATE_HZ = 50.0  # after decimation
TILT_STEP = 1e-4  # [rad], for the derivative with respect to the direction of gravity


@dataclass(frozen=True, eq=False)
class EquationSamples:
    """Rows of several recordings one after the other; arrays (N, J) unless noted."""

    joints: tuple[str, ...]
    links: tuple[str, ...]
    role: str
    time: np.ndarray  # (N,) [s]
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    effort: np.ndarray
    commanded: np.ndarray
    rigid: np.ndarray  # nominal inverse dynamics [N m]
    gain_terms: tuple[np.ndarray, np.ndarray]  # stiffness and damping parts of the described law
    residuals: tuple[np.ndarray, np.ndarray, np.ndarray]  # controller, drive and links together, links
    delayed: dict[float, np.ndarray]  # delay [s] -> commanded effort that much earlier
    lagged: dict[float, np.ndarray]  # time constant [s] -> commanded effort through a first-order low-pass
    regressor: np.ndarray  # (N, J, J, 10) per inertial parameter of a link
    position_derivative: np.ndarray  # (N, J, J)
    tilt: np.ndarray  # (N, J, 2) torque per tilt about the base's x and y [N m/rad]
    limits: np.ndarray  # (J,) effort limits [N m]
    recording: np.ndarray  # (N,) which recording a row is of


def make_samples(recordings: Sequence[ArmRecording], delays: Sequence[float]) -> EquationSamples:
    """Filter, thin and evaluate the nominal model.

    Raises:
        InputError: a recording without URDF, controller, command, velocity or both efforts.
    """
    parts = [_one(recording, delays, k) for k, recording in enumerate(recordings)]
    first = parts[0]

    def joined(pick: Callable[[EquationSamples], np.ndarray]) -> np.ndarray:
        return np.concatenate([pick(p) for p in parts])

    return EquationSamples(
        joints=first.joints,
        links=first.links,
        role=first.role,
        time=joined(lambda p: p.time),
        q=joined(lambda p: p.q),
        dq=joined(lambda p: p.dq),
        ddq=joined(lambda p: p.ddq),
        effort=joined(lambda p: p.effort),
        commanded=joined(lambda p: p.commanded),
        rigid=joined(lambda p: p.rigid),
        gain_terms=(joined(lambda p: p.gain_terms[0]), joined(lambda p: p.gain_terms[1])),
        residuals=(
            joined(lambda p: p.residuals[0]),
            joined(lambda p: p.residuals[1]),
            joined(lambda p: p.residuals[2]),
        ),
        delayed={d: joined(lambda p, d=d: p.delayed[d]) for d in delays},
        lagged={d: joined(lambda p, d=d: p.lagged[d]) for d in delays},
        regressor=joined(lambda p: p.regressor),
        position_derivative=joined(lambda p: p.position_derivative),
        tilt=joined(lambda p: p.tilt),
        limits=first.limits,
        recording=joined(lambda p: p.recording),
    )


def _one(recording: ArmRecording, delays: Sequence[float], number: int) -> EquationSamples:
    arm, states, command = recording.arm, recording.states, recording.command
    if arm.controller is None or command is None or recording.commanded_effort is None:
        raise InputError(
            f"{recording.name} has no controller, command or commanded effort; baselines need them"
        )
    channels = {
        "position": states.position,
        "velocity": states.velocity,
        "effort": states.effort,
        "commanded effort": recording.commanded_effort.effort,
        "command": command.position,
        "command velocity": command.velocity,
    }
    if lacking := [name for name, values in channels.items() if values is None]:
        raise InputError(f"{recording.name} lacks {lacking}; baselines need them")
    rate = (len(states.time) - 1) / (states.time[-1] - states.time[0])
    sections = butter(3, min(CUTOFF_HZ / (0.5 * rate), 0.9), output="sos")
    step = max(1, round(rate / RATE_HZ))
    margin = int(0.2 * rate)  # where the filter still knows its own ends
    keep = slice(margin, len(states.time) - margin, step)

    def smooth(values: np.ndarray | None) -> np.ndarray:
        return sosfiltfilt(sections, np.asarray(values, float), axis=0)

    q, dq = smooth(states.position), smooth(states.velocity)
    ddq = np.gradient(dq, states.time, axis=0)
    effort, commanded = smooth(states.effort), smooth(channels["commanded effort"])
    model = RigidArm(arm)
    gravity = model.gravity(q[keep]) if arm.controller.gravity_compensation else 0.0
    spring = arm.controller.stiffness * (smooth(command.position) - q)
    damper = arm.controller.damping * (smooth(command.velocity) - dq)
    forward = smooth(command.effort)[keep] if command.effort is not None else 0.0
    armature = arm.controller.armature if arm.controller.armature is not None else np.zeros(len(arm.joints))
    rows = (q[keep], dq[keep], ddq[keep])
    rigid = model.inverse_dynamics(*rows)
    down = model.gravity_vector
    tilt = [
        (model.inverse_dynamics(*rows, gravity=down + TILT_STEP * np.cross(axis, down)) - rigid) / TILT_STEP
        for axis in (np.array([1.0, 0, 0]), np.array([0, 1.0, 0]))
    ]
    limit = arm.controller.effort_limit if arm.controller.effort_limit is not None else model.effort_limits()
    delayed = {
        d: np.stack([np.interp(states.time - d, states.time, column) for column in commanded.T], axis=1)[keep]
        for d in delays
    }
    lagged = {}
    for d in delays:
        pole = float(np.exp(-1 / (rate * d)))
        start = pole * commanded[:1]  # as if the first value had been there for ever
        lagged[d] = lfilter([1 - pole], [1, -pole], commanded, axis=0, zi=start)[0][keep]
    return EquationSamples(
        joints=arm.joints,
        links=model.links,
        role=arm.role,
        time=states.time[keep],
        q=rows[0],
        dq=rows[1],
        ddq=rows[2],
        effort=effort[keep],
        commanded=commanded[keep],
        rigid=rigid,
        gain_terms=(spring[keep], damper[keep]),
        residuals=(
            commanded[keep] - spring[keep] - damper[keep] - gravity - forward,
            commanded[keep] - armature * rows[2] - rigid,
            effort[keep] - rigid,
        ),
        delayed=delayed,
        lagged=lagged,
        regressor=model.regressor(*rows),
        position_derivative=model.position_derivative(*rows),
        tilt=np.stack(tilt, axis=2),
        limits=np.asarray(limit, float),
        recording=np.full(len(rows[0]), number),
    )
