"""Machines whose nominal model is an MJCF, made and recorded by plain MuJoCo, with nothing of samrl.

A world is a chain of two to five links with position servos, or with motors under a joint impedance of this
file. The machine is the same text with hidden differences: changed elements, or what is done in its step.
`simulate` is also used to judge an exported model, so what is compared has passed through no code of the
diagnosis.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import mujoco as _mujoco
import numpy as np

mujoco: Any = _mujoco
STEP, LOG_STEP, DURATION = 0.001, 0.002, 8.0  # [s]
NOISE = {"position": 2e-5, "velocity": 5e-4, "effort": 0.02, "commanded_effort": 0.005}
KINDS = (
    "coulomb", "damping", "mass", "stribeck", "payload", "gain", "less_friction", "armature", "delay", "load",
)  # fmt: skip


@dataclass
class World:
    """One machine and its nominal model."""

    seed: int
    kind: str
    servo: bool
    nominal: str  # MJCF
    machine: str  # MJCF
    joints: tuple[str, ...]
    stiffness: np.ndarray
    damping: np.ndarray
    limit: np.ndarray
    place: str
    size: float
    step: dict[str, Any] = field(default_factory=dict)  # what the machine does beyond its MJCF


def make_world(seed: int, kind: str, servo: bool) -> World:
    """A world with one hidden difference of a kind, of a middling size."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 5))
    lengths = rng.uniform(0.15, 0.35, count)
    masses = rng.uniform(0.8, 3.0, count) * np.linspace(1.0, 0.5, count)
    axes = (
        ["0 0 1", "0 1 0", "0 1 0", "1 0 0"][:count]
        if rng.random() < 0.5
        else ["0 1 0", "0 1 0", "0 0 1", "0 1 0"][:count]
    )
    reach = np.cumsum(lengths[::-1])[::-1]
    heavy = np.cumsum(masses[::-1])[::-1]
    limit = np.round(np.maximum(3.0 * 9.81 * heavy * reach, 15.0), 1)
    armature = np.round(limit * 1e-3, 4)
    inertia = heavy * reach**2 / 3 + armature
    stiffness = np.round(inertia * (2 * np.pi * 4.0) ** 2 + 2.0 * limit, 1)
    damping = np.round(1.4 * np.sqrt(stiffness * inertia), 2)
    loss, slope = np.round(0.008 * limit, 4), np.round(0.004 * limit, 4)
    joints = tuple(f"axis{k + 1}" for k in range(count))
    j = int(rng.integers(0, count))
    values = {
        "frictionloss": loss.copy(), "damping": slope.copy(), "armature": armature.copy(),
        "mass": masses.copy(),
        "kp": stiffness.copy(), "kv": damping.copy(), "gear": np.ones(count), "payload": 0.0,
    }  # fmt: skip

    def text(v: dict[str, Any]) -> str:
        return _mjcf(joints, axes, lengths, limit, servo, v)

    nominal = text(values)
    step: dict[str, Any] = {}
    size = 0.0
    if kind == "coulomb":
        size = float(np.round(0.03 * limit[j] * rng.uniform(0.8, 1.6), 4))
        step = {"joint": j, "level": size}
    elif kind == "less_friction":
        j = int(rng.integers(0, count))
        nominal = text(
            {**values, "frictionloss": values["frictionloss"] + np.eye(count)[j] * 0.04 * limit[j]}
        )
        size = float(-0.04 * limit[j])
    elif kind == "damping":
        size = float(np.round(0.03 * limit[j] * rng.uniform(0.8, 1.6), 4))
        values["damping"][j] += size
    elif kind == "armature":
        size = float(np.round(inertia[j] * rng.uniform(0.3, 0.6), 4))
        values["armature"][j] += size
    elif kind == "mass":
        j = int(rng.integers(max(1, count - 2), count))
        size = float(np.round(values["mass"][j] * rng.uniform(0.2, 0.4), 3))
        values["mass"][j] += size
    elif kind == "payload":
        j = count - 1
        size = float(np.round(0.3 * masses.sum() * rng.uniform(0.5, 1.0), 3))
        values["payload"] = size
    elif kind == "gain":
        size = float(-rng.uniform(0.12, 0.25))
        if servo:
            values["kp"][j] *= 1 + size
            values["kv"][j] *= 1 + size
        else:
            values["gear"][j] *= 1 + size
    elif kind == "stribeck":
        size = float(0.05 * limit[j])
        step = {"joint": j, "level": 0.02 * limit[j], "drop": size, "speed": 0.08}
    elif kind == "load":
        size = 0.12
        step = {"joint": j, "load": size}
    elif kind == "delay":
        size = float(rng.uniform(0.006, 0.014))
        step = {"delay": size}
    return World(
        seed, kind, servo, nominal, text(values), joints, stiffness, damping, limit, joints[j], size, step
    )


def _mjcf(joints: Any, axes: Any, lengths: Any, limit: Any, servo: bool, v: dict[str, Any]) -> str:
    head, tail = "", ""
    for k, name in enumerate(joints):
        at = "0 0 0.3" if k == 0 else f"{lengths[k - 1]:.4f} 0 0"
        head += (
            f'<body name="link{k + 1}" pos="{at}"><joint name="{name}" axis="{axes[k]}"'
            f' armature="{v["armature"][k]}"'
            f' damping="{v["damping"][k]}" frictionloss="{v["frictionloss"][k]}"/>'
            f'<geom type="capsule" fromto="0 0 0 {lengths[k]:.4f} 0 0" size="0.03" mass="{v["mass"][k]}"/>\n'
        )
        tail += "</body>"
    if v["payload"]:
        head += f'<geom type="sphere" pos="{lengths[-1]:.4f} 0.02 0" size="0.04" mass="{v["payload"]}"/>'
    drives = ""
    for k, name in enumerate(joints):
        if servo:
            drives += f'<position joint="{name}" kp="{v["kp"][k]}" kv="{v["kv"][k]}"'
            drives += f' forcerange="-{limit[k]} {limit[k]}"/>\n'
        else:
            drives += f'<motor joint="{name}" gear="{v["gear"][k]}" ctrlrange="-{limit[k]} {limit[k]}"/>\n'
    return (
        f'<mujoco model="chain">\n<compiler angle="radian"/>\n<option timestep="{STEP}">'
        f'<flag contact="disable"/></option>\n<worldbody>\n{head}{tail}\n</worldbody>\n'
        f"<actuator>\n{drives}</actuator>\n"
        "</mujoco>\n"
    )


def command(programme: str, count: int, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities (N, J) of what the controller tracks."""
    rng = np.random.default_rng({"A": 1, "B": 2, "C": 3}[programme])
    t = time[:, None]
    rise = 1 - np.exp(-((t / 0.6) ** 3))
    home = rng.uniform(-0.6, 0.6, count)
    if programme == "A":  # slow reversals
        f, a = rng.uniform(0.25, 0.5, count), rng.uniform(0.3, 0.6, count)
        q = home + rise * a * np.sin(2 * np.pi * f * t + rng.uniform(0, 6, count))
    elif programme == "B":  # faster, several sines
        q = home + 0 * t
        for _ in range(4):
            f = rng.uniform(0.3, 2.2, count)
            q = q + rise * 0.25 / (0.5 + f) * np.sin(2 * np.pi * f * t + rng.uniform(0, 6, count))
    else:  # task-like: point to point with rests
        q = home + 0 * t
        for begin in (0.4, 2.2, 4.2, 6.0):
            s = np.clip((t - begin) / 1.2, 0, 1)
            q = q + rng.uniform(-0.9, 0.9, count) * (s**3 * (10 - 15 * s + 6 * s**2))
    return q, np.gradient(q, time, axis=0)


def simulate(
    text: str, world: World, programme: str, step: dict[str, Any] | None = None
) -> dict[str, np.ndarray]:
    """What a model does under the world's controller; noise-free, at the log's rate."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    nominal = mujoco.MjModel.from_xml_string(world.nominal)
    still = mujoco.MjData(nominal)
    time = np.arange(0, DURATION + STEP / 2, STEP)
    count = len(world.joints)
    q, v = command(programme, count, time)
    data.qpos[:], data.qvel[:] = q[0], v[0]
    step = step or {}
    shift = step.get("delay", 0.0)
    late_q = np.stack([np.interp(time - shift, time, c) for c in q.T], 1)
    # What a servo says of its own effort knows its command as late as the actuator does.
    behind = shift + (float(np.max(model.actuator_delay)) if world.servo else 0.0)
    told_q = np.stack([np.interp(time - behind, time, c) for c in q.T], 1)
    late_v = np.stack([np.interp(time - shift, time, c) for c in v.T], 1)
    apply: Callable[[], None] = lambda: None  # noqa: E731
    if "joint" in step:
        j = step["joint"]

        unit, column, last = np.eye(count)[j], np.zeros(count), 0.0

        def apply() -> None:
            """Dry friction that holds: what would stop the joint in this step, up to its level."""
            nonlocal last
            speed = float(data.qvel[j])
            level = step.get("level", 0.0)
            level += step.get("drop", 0.0) * float(np.exp(-((speed / step.get("speed", 1.0)) ** 2)))
            mujoco.mj_mulM(model, data, column, unit)
            moving = column[j] * float(data.qacc[j])
            level += step.get("load", 0.0) * abs(moving + float(data.qfrc_bias[j]))
            stops = -(column[j] * speed / STEP + moving - last)
            last = float(np.clip(stops, -level, level))
            data.qfrc_applied[j] = last

    out: dict[str, list[np.ndarray]] = {
        "position": [],
        "velocity": [],
        "commanded_effort": [],
        "target": [],
        "speed": [],
    }
    if world.servo and np.any(model.actuator_delay):  # a history of zeros at first: hold the first command
        for _ in range(int(np.max(model.actuator_delay) / STEP) + 3):
            data.ctrl[:] = q[0]
            mujoco.mj_step(model, data)
            data.qpos[:], data.qvel[:] = q[0], v[0]
    every = round(LOG_STEP / STEP)
    for k in range(len(time)):
        if world.servo:
            data.ctrl[:] = late_q[k]
            sent = world.stiffness * (told_q[k] - data.qpos) - world.damping * data.qvel
        else:
            still.qpos[:] = data.qpos
            still.qvel[:] = 0
            mujoco.mj_forward(nominal, still)
            sent = world.stiffness * (late_q[k] - data.qpos) + world.damping * (late_v[k] - data.qvel)
            sent = sent + still.qfrc_bias
            data.ctrl[:] = np.clip(sent, -world.limit, world.limit)
        sent = np.clip(sent, -world.limit, world.limit)
        if k % every == 0:
            for name, value in (
                ("position", data.qpos), ("velocity", data.qvel), ("commanded_effort", sent),
                ("target", q[k]), ("speed", 0 * v[k] if world.servo else v[k]),
            ):  # fmt: skip
                out[name].append(np.array(value))
        apply()
        mujoco.mj_step(model, data)
    return {"time": time[::every], **{name: np.array(rows) for name, rows in out.items()}}


def record(world: World, programme: str) -> dict[str, np.ndarray]:
    """A log of the machine, with noise; of the controller's reading and its own torque alike."""
    rng = np.random.default_rng([world.seed, ord(programme)])
    log = simulate(world.machine, world, programme, world.step)
    for name, size in NOISE.items():
        if name in log:
            log[name] = log[name] + size * rng.standard_normal(log[name].shape)
    return log


def gap(log: dict[str, np.ndarray], run: dict[str, np.ndarray], scale: dict[str, np.ndarray]) -> float:
    """Root mean square of the differences in units of a scale, all quantities and joints alike."""
    parts = [((log[name] - run[name]) / scale[name]) ** 2 for name in scale]
    return float(np.sqrt(np.mean(np.concatenate(parts, axis=1))))
