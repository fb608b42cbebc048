"""A pendulum on a PD loop whose driver low-passes speeds, by an integration of its own: plain NumPy alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import signal

from samrl_core.cell.types.arm_description import ArmController, ArmDescription
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal

JOINT, MASS, ARM, INERTIA = "swing", 1.2, 0.25, 0.004  # [kg], [m], [kg m2] of the link about its centre
ROTOR, FRICTION, VISCOUS = 0.02, 0.35, 0.08  # [kg m2], [N m], [N m s/rad]
STIFFNESS, DAMPING = 60.0, 3.0  # [N m/rad], [N m s/rad]
PERIOD_S, SUBSTEPS, LAG_S, SECONDS = 0.001, 8, 0.0025, 8.0
COUNTS, TORQUE_NOISE = 120_000, 0.02  # of the encoder in a turn; [N m] of a measured current
URDF = f"""<robot name="pendulum"><link name="base"/><link name="rod"><inertial><origin xyz="{ARM} 0 0"/>
<mass value="{MASS}"/><inertia ixx="{INERTIA}" iyy="{INERTIA}" izz="{INERTIA}" ixy="0" ixz="0" iyz="0"/>
</inertial></link><joint name="{JOINT}" type="revolute"><parent link="base"/><child link="rod"/>
<axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="20" velocity="10"/>
<dynamics friction="{FRICTION}" damping="{VISCOUS}"/></joint></robot>"""


@dataclass(frozen=True, eq=False)
class Run:
    """What happened at each period (F,), free of noise."""

    time: np.ndarray
    command: np.ndarray
    command_speed: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    torque: np.ndarray  # that the loop asked for
    reported: np.ndarray  # velocity behind the driver's filter


def path(time: np.ndarray) -> np.ndarray:
    """A chirp that reverses often, on a slow sine."""
    phase = 2 * np.pi * (0.5 * time + 0.5 * 2.5 / SECONDS * time**2)
    return 0.5 * np.sin(1.3 * time) + 0.3 * (np.cos(phase) - 1.0) * np.minimum(time, 1.0)


def swing(damps_reported: bool, delay_s: float = 0.0) -> Run:
    """The machine; its loop damps what the driver reports or the speed itself; its command may be late."""
    time = np.arange(0.0, SECONDS, PERIOD_S)
    command = path(time)
    speed = np.gradient(command, PERIOD_S)
    late, late_speed = (np.interp(time - delay_s, time, x) for x in (command, speed))
    total, h = INERTIA + MASS * ARM**2 + ROTOR, PERIOD_S / SUBSTEPS
    q, v, reported = float(command[0]), 0.0, 0.0
    share = PERIOD_S / (PERIOD_S + LAG_S)  # late by just that
    rows = np.empty((len(time), 4))
    for k in range(len(time)):
        reported += share * (v - reported)
        u = STIFFNESS * (late[k] - q) + DAMPING * (late_speed[k] - (reported if damps_reported else v))
        rows[k] = q, v, u, reported
        for _ in range(SUBSTEPS):
            pull = u + MASS * 9.81 * ARM * np.cos(q) - VISCOUS * v
            free = v + h * pull / total
            held = h * FRICTION / total
            v = free - np.clip(free, -held, held)
            q += h * v
    return Run(time, command, speed, *rows.T)


def record(run: Run, seed: int = 0, rate_hz: float = 500.0) -> ArmRecording:
    """A driver's log of it: counted positions, the reported velocity, a noisy torque."""
    rng, every = np.random.default_rng(seed), round(1.0 / (PERIOD_S * rate_hz))
    tick = 2.0 * np.pi / COUNTS
    time = run.time[::every]
    measured = run.torque + TORQUE_NOISE * rng.standard_normal(len(run.time))
    q, v, u, goal, speed = (
        x[::every, None]
        for x in (
            tick * np.round(run.position / tick),
            run.reported,
            measured,
            run.command,
            run.command_speed,
        )
    )
    controller = ArmController(
        (JOINT,), np.array([STIFFNESS]), np.array([DAMPING]), PERIOD_S, gravity_compensation=False,
        armature=np.array([ROTOR]),
    )  # fmt: skip
    about = ArmDescription("tool_arm", (JOINT,), URDF, controller)
    return ArmRecording(
        "swing", "swing.npz", "0" * 64, about, JointSignal(time, q, v), JointSignal(time, goal, speed),
        JointSignal(time, effort=u),
    )  # fmt: skip


def low_passed(x: np.ndarray, lag_s: float) -> np.ndarray:
    """Samples (F,) a period apart behind a low-pass of a time constant, the delay of which it has exactly."""
    share = PERIOD_S / (PERIOD_S + lag_s)
    return np.asarray(signal.lfilter([share], [1.0, share - 1.0], x, zi=[(1.0 - share) * x[0]])[0])
