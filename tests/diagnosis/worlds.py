"""Recordings of a small arm for the tests, made by the closed-loop simulator: one known difference at a time.

The arm turns about the vertical, then lifts with two joints. The programmes are holds and reversals (A),
a chirp with a sine (B), a task-like motion at other gains (C, held out), and A with rough torques (D).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from samrl_core.cell.types.arm_description import ArmController, ArmDescription
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.simulation.closed_loop import ClosedLoop, Rollouts
from samrl_core.diagnosis.simulation.loop_model import LoopModel
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm

JOINTS = ("turn", "lift", "bend")
TURN, LIFT, BEND = range(3)
STIFFNESS, DAMPING = np.array([300.0, 400.0, 150.0]), np.array([24.0, 30.0, 10.0])
ARMATURE = np.array([0.06, 0.06, 0.02])  # [kg m2]
HOME = np.array([0.2, 0.5, 0.7])  # [rad]
POSITION_NOISE, VELOCITY_NOISE, EFFORT_NOISE = 2e-5, 5e-4, 0.02  # [rad], [rad/s], [N m]
DURATION_S = 8.0

_LINK = """<link name="{name}"><inertial><origin xyz="{com}"/><mass value="{mass}"/>
<inertia ixx="{i[0]}" iyy="{i[1]}" izz="{i[2]}" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
_JOINT = """<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>
<origin xyz="{xyz}"/><axis xyz="{axis}"/><limit lower="-2.8" upper="2.8" effort="{effort}" velocity="3"/>
</joint>"""


def _urdf() -> str:
    links = (
        ("post", "0 0 0.08", 3.0, (0.02, 0.02, 0.012)),
        ("upper", "0.16 0.01 0", 2.2, (0.004, 0.02, 0.02)),
        ("fore", "0.14 0 0.01", 1.3, (0.002, 0.009, 0.009)),
    )
    joints = (
        ("turn", "base", "post", "0 0 0.1", "0 0 1", 40),
        ("lift", "post", "upper", "0 0 0.15", "0 1 0", 40),
        ("bend", "upper", "fore", "0.32 0 0", "0 1 0", 20),
    )
    body = "".join(_LINK.format(name=n, com=c, mass=m, i=i) for n, c, m, i in links)
    body += "".join(
        _JOINT.format(name=n, parent=p, child=c, xyz=x, axis=a, effort=e) for n, p, c, x, a, e in joints
    )
    return f'<robot name="small"><link name="base"/>{body}</robot>'


URDF = _urdf()


def arm(gains: float = 1.0) -> ArmDescription:
    """The nominal arm; `gains` scales stiffness, and damping by its root."""
    controller = ArmController(JOINTS, STIFFNESS * gains, DAMPING * np.sqrt(gains), armature=ARMATURE)
    return ArmDescription("tool_arm", JOINTS, URDF, controller)


def plant(**fields: Any) -> PlantParameters:
    """A plant; per-joint fields may be given as {joint: value}, neutral elsewhere."""
    return replace(PlantParameters(), **{name: spread(name, value) for name, value in fields.items()})


def spread(name: str, value: Any) -> Any:
    """{joint: value} as an array over the joints."""
    if not isinstance(value, Mapping):
        return value
    out = np.full(len(JOINTS), float(getattr(PlantParameters(), name)))
    for joint, v in value.items():
        out[joint] = v
    return out


def background(rng: np.random.Generator) -> dict[str, Any]:
    """What a nominal arm may differ by, well inside the tolerances: masses, offsets, tilt, some friction."""
    nominal = RigidArm(arm()).inertial_parameters
    limit = np.array([40.0, 40.0, 20.0])
    return {
        "inertial_delta": nominal * rng.uniform(-0.01, 0.01, size=(3, 1)),
        "torque_offset": limit * rng.uniform(-0.002, 0.002, 3),
        "coulomb": limit * rng.uniform(0.0, 0.0007, 3),
        "rotor_inertia": ARMATURE * rng.uniform(0.0, 0.01, 3),
        "gravity": np.array([*(9.81 * rng.uniform(-3e-4, 3e-4, 2)), -9.81]),
    }


def merged(real: PlantParameters, fields: Mapping[str, Any]) -> PlantParameters:
    """A plant with a background added where it is neutral already, else on top."""
    changes = {}
    for name, value in fields.items():
        here = getattr(real, name)
        if name == "inertial_delta":
            value = value if here is None else here + value
        elif name == "gravity":
            value = value if here is None else here + (value - np.array([0.0, 0.0, -9.81]))
        else:
            value = np.broadcast_to(np.asarray(here, float), (3,)) + value
        changes[name] = value
    return replace(real, **changes)


# -- programmes -----------------------------------------------------------------------------------------


def _smooth(time: np.ndarray, knots: Sequence[float], values: np.ndarray) -> np.ndarray:
    """Piecewise quintic blend through values (K, J) at knots, at rest in each."""
    out = np.repeat(values[:1], len(time), axis=0)
    for k in range(len(knots) - 1):
        s = np.clip((time - knots[k]) / (knots[k + 1] - knots[k]), 0.0, 1.0)
        blend = s**3 * (10 - 15 * s + 6 * s**2)
        out = out + blend[:, None] * (values[k + 1] - values[k])
    return out


def reversals(time: np.ndarray) -> np.ndarray:
    """A: two seconds of holds in four poses, then slow sines that turn back in all joints."""
    poses = HOME + np.array([[0, 0, 0], [0.5, -0.6, 0.5], [-0.4, 0.3, -0.9], [0.3, -0.3, 0.3]])
    holds = _smooth(time, (0.3, 0.9, 1.1, 1.7, 1.9, 2.5), np.repeat(poses, (1, 2, 2, 1), axis=0))
    t = np.maximum(time - 2.7, 0.0)[:, None]
    start = 1.0 - np.exp(-((t / 0.4) ** 3))
    return holds + start * np.array([0.22, 0.2, 0.25]) * np.sin(2 * np.pi * np.array([0.6, 0.47, 0.71]) * t)


def chirp(time: np.ndarray) -> np.ndarray:
    """B: a chirp to 4 Hz on slow sines."""
    t, end = time[:, None], time[-1]
    phase = 2 * np.pi * (0.4 * t + 0.5 * (4.0 - 0.4) / end * t**2) + np.array([0.0, 2.1, 4.2])
    fast = np.array([0.03, 0.025, 0.035]) / (0.4 + t / end) * (np.sin(phase) - np.sin(phase[0]))
    slow = np.array([0.4, 0.35, 0.5]) * np.sin(2 * np.pi * np.array([0.31, 0.27, 0.37]) * t)
    ramp = 1.0 - np.exp(-((t / 0.4) ** 3))
    return HOME + ramp * (fast + slow)


def task(time: np.ndarray) -> np.ndarray:
    """C: point to point as in work, with rests, in other poses."""
    offsets = np.array([[0, 0, 0], [0.7, 0.4, -0.6], [-0.3, -0.5, 0.4], [0.2, 0.5, 0.5], [-0.6, -0.1, -0.4]])
    poses = HOME + np.array([-0.2, 0.1, 0.1]) + offsets
    return _smooth(
        time, (0.3, 1.3, 1.6, 2.6, 2.9, 4.1, 4.3, 5.3, 5.6, 6.8), np.repeat(poses, (1, 2, 2, 2, 3), axis=0)
    )


# path, factor of the gains, and torque that is fed forward at random each period [N m]
PROGRAMMES: dict[str, tuple[Callable[[np.ndarray], np.ndarray], float, float]] = {
    "A": (reversals, 1.0, 0.0), "B": (chirp, 1.0, 0.0), "C": (task, 0.6, 0.0), "D": (reversals, 1.0, 1.0),
}  # fmt: skip


@cache
def loop(gains: float) -> ClosedLoop:
    """Simulator of the arm at some gains."""
    return ClosedLoop(LoopModel(arm(gains)))


def commanded(programme: str, duration_s: float) -> JointSignal:
    """What the controller tracks in a programme."""
    path, _, rough = PROGRAMMES[programme]
    time = np.arange(0.0, duration_s + 5e-4, 0.001)
    position = path(time)
    dither = rough * np.random.default_rng(7).uniform(-1.0, 1.0, position.shape)
    return JointSignal(time, position, np.gradient(position, 0.001, axis=0), None, dither)


def rollout(real: PlantParameters, programme: str, duration_s: float = DURATION_S) -> Rollouts:
    """What a plant does in a programme, free of noise."""
    command = commanded(programme, duration_s)
    assert command.position is not None and command.velocity is not None
    simulator = loop(PROGRAMMES[programme][1])
    return simulator.rollout(command, command.position[0], command.velocity[0], [real], duration_s)


def record(
    real: PlantParameters,
    programmes: str = "ABC",
    rng: np.random.Generator | None = None,
    duration_s: float = DURATION_S,
) -> list[ArmRecording]:
    """Recordings of a plant in some programmes; without a generator free of noise."""
    out = []
    for name in programmes:
        run = rollout(real, name, duration_s)
        q, v, e, u = (x[0] for x in (run.position, run.velocity, run.effort, run.commanded_effort))
        if rng is not None:
            q = q + POSITION_NOISE * rng.standard_normal(q.shape)
            v = v + VELOCITY_NOISE * rng.standard_normal(v.shape)
            e = e + EFFORT_NOISE * rng.standard_normal(e.shape)
        described = loop(PROGRAMMES[name][1]).arm
        out.append(
            ArmRecording(
                name, f"{name}.mcap", "0" * 64, described, JointSignal(run.time, q, v, None, e),
                commanded(name, duration_s), JointSignal(run.time, effort=u),
            )
        )  # fmt: skip
    return out


def world(seed: int, programmes: str = "ABC", **fields: Any) -> list[ArmRecording]:
    """Noisy recordings with a background; `fields` are the difference that is to be found."""
    rng = np.random.default_rng(seed)
    return record(merged(plant(**fields), background(rng)), programmes, rng)


def trials(recordings: Sequence[ArmRecording]) -> list[Trial]:
    """As the diagnosis sees recordings made one after another."""
    out, start = [], 0.0
    for recording in recordings:
        out.append(Trial(recording, RigidArm(recording.arm), start))
        start += recording.duration
    return out
