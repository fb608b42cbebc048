"""One motion as popular packages write it: DROID, robomimic, Isaac Lab, libfranka, pandas, Simulink."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from scipy.io import savemat

from tests.recordings.logs.made_logs import COUNT, JOINTS, MOTION, by_joint

SEVEN = tuple(f"[{k}]" for k in range(7))
UR = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", *(f"wrist_{k}_joint" for k in (1, 2, 3)))
PANDA = tuple(f"panda_joint{k}" for k in range(1, 8))


def _h5py() -> Any:
    return pytest.importorskip("h5py")


def droid(folder: Path, hz: float = 15.0) -> Path:
    """`trajectory.h5` of the raw data: clocks in several groups, and the state once more in the action."""
    rate, time = hz / 100.0, 1.68e9 + MOTION.time * 100.0 / hz  # as many samples, over a longer time
    with _h5py().File(folder / "trajectory.h5", "w") as file:
        file["action/joint_position"] = MOTION.target
        file["action/gripper_position"] = np.zeros(COUNT)
        for place in ("action/robot_state", "observation/robot_state"):
            state = file.create_group(place)
            state["joint_positions"], state["joint_velocities"] = MOTION.position, rate * MOTION.velocity
            for name in ("joint_torques_computed", "prev_joint_torques_computed_safened"):
                state[name] = 0.5 * MOTION.effort
            state["motor_torques_measured"] = MOTION.effort
            state["prev_controller_latency_ms"] = 0.2 + 0.05 * np.sin(np.arange(COUNT) ** 2.0)
        stamps = file.create_group("observation/timestamp")
        stamps["cameras/123_read_start"] = np.floor(1e3 * time) + 40.0
        stamps["control/step_start"] = np.floor(1e3 * time) - 9.0
        stamps["robot_state/read_start"] = np.floor(1e3 * time)
        stamps["robot_state/robot_timestamp_seconds"] = np.floor(time)
    return folder / "trajectory.h5"


def robomimic(folder: Path, count: int = 3) -> Path:
    """Demonstrations at 20 Hz without a clock, sines beside angles, and the state after each action."""
    rate = 20.0 / 100.0
    with _h5py().File(folder / "low_dim.hdf5", "w") as file:
        for k in range(count):
            shown = {
                name: np.roll(getattr(MOTION, name), 50 * k, axis=0) for name in ("position", "velocity")
            }
            group = file.create_group(f"data/demo_{k}")
            group["actions"] = np.random.default_rng(k).uniform(-1.0, 1.0, (COUNT, 3))
            for place, late in (("next_obs", -1), ("obs", 0)):
                q, dq = (np.roll(shown[name], late, axis=0) for name in ("position", "velocity"))
                group[f"{place}/robot0_joint_pos"], group[f"{place}/robot0_joint_vel"] = q, rate * dq
                group[f"{place}/robot0_joint_pos_cos"] = np.cos(q)
                group[f"{place}/robot0_joint_pos_sin"] = np.sin(q)
    return folder / "low_dim.hdf5"


def isaac_lab(folder: Path) -> Path:
    """Positions observed from the default pose on, beside the states of the articulation."""
    with _h5py().File(folder / "dataset.hdf5", "w") as file:
        for k in range(2):
            group = file.create_group(f"data/demo_{k}")
            group["obs/joint_pos"], group["obs/joint_vel"] = MOTION.position - 0.7, 0.5 * MOTION.velocity
            group["states/articulation/robot/joint_position"] = MOTION.position
            group["states/articulation/robot/joint_velocity"] = 0.5 * MOTION.velocity
    return folder / "dataset.hdf5"


def libfranka_log(folder: Path) -> Path:
    """`franka::logToCSV` before release 0.14: blanks behind commas, names twice, ms without a unit."""

    def names(stem: str, count: int = 7) -> str:
        return ", ".join(f"{stem}[{k}]" for k in range(count))

    seven = np.resize(np.arange(3), 7)
    measured = [MOTION.position, MOTION.target, MOTION.velocity, MOTION.velocity, MOTION.effort]
    ticks = 10.0 * np.arange(COUNT)[:, None]
    rows = [ticks, np.ones((COUNT, 1)), *(values[:, seven] for values in measured)]
    sent = np.column_stack([MOTION.target[:, seven], np.zeros((COUNT, 16)), 0.1 * MOTION.effort[:, seven]])
    head = "duration, success rate, " + ",".join(map(names, ("q", "q_d", "dq", "dq_d", "tau_J")))
    head += f",sent commands,{names('q_d')},{names('O_T_EE_d', 16)},{names('tau_J_d')}"
    lines = [
        f"{','.join(f'{x:.9g}' for x in row)},,{','.join(f'{x:.9g}' for x in command)}"
        for row, command in zip(np.column_stack(rows), sent, strict=True)
    ]
    (folder / "log.csv").write_text("\n".join([head, *lines]) + "\n")
    return folder / "log.csv"


def _frame() -> pd.DataFrame:
    pytest.importorskip("pyarrow")
    stamps = pd.to_datetime((1.7e9 + MOTION.time) * 1e9)
    return pd.DataFrame(
        {"timestamp": stamps} | by_joint("{}_pos", MOTION.position, JOINTS)
        | by_joint("{}_vel", MOTION.velocity, JOINTS) | by_joint("{}_torque_nm", MOTION.effort, JOINTS)
    )  # fmt: skip


def pandas_parquet(folder: Path) -> Path:
    _frame().set_index("timestamp").to_parquet(folder / "log.parquet")
    return folder / "log.parquet"


def pandas_feather(folder: Path) -> Path:
    _frame().to_feather(folder / "log.feather")
    return folder / "log.feather"


def simulink(folder: Path) -> Path:
    """To Workspace blocks in Array form: (J, 1, N), beside `tout`."""
    arrays = {"q": MOTION.position, "trq": MOTION.effort}
    stacked = {name: values.T[:, None, :] for name, values in arrays.items()}
    savemat(folder / "out.mat", {"tout": MOTION.time[:, None], **stacked})
    return folder / "out.mat"


def rtde_csv(folder: Path) -> Path:
    """ur_rtde's recorder: six joints counted from 0, model moments, the tool's force, currents."""
    six, names = np.resize(np.arange(3), 6), tuple("012345")
    columns = {"timestamp": 4500.128 + MOTION.time}
    for stem, values in (
        ("target_q", MOTION.target), ("target_moment", MOTION.effort), ("actual_q", MOTION.position),
        ("actual_qd", MOTION.velocity), ("actual_current", 0.1 * MOTION.effort),
        ("actual_TCP_force", MOTION.effort),
    ):  # fmt: skip
        columns |= by_joint(f"{stem}_{{}}", values[:, six], names)
    pd.DataFrame(columns).to_csv(folder / "robot_data.csv", index=False)
    return folder / "robot_data.csv"


def libfranka_new_log(folder: Path) -> Path:
    """`franka::logToCSV` from release 0.14 on: `state.` and `cmd.` before the names."""
    seven, names = np.resize(np.arange(3), 7), tuple("0123456")
    columns = {"time": 91234.0 + 10.0 * np.arange(COUNT), "success_rate": np.ones(COUNT)}
    for stem, values in (
        ("state.q", MOTION.position), ("state.q_d", MOTION.target), ("state.dq", MOTION.velocity),
        ("state.tau_J", MOTION.effort), ("cmd.q_d", 0.0 * MOTION.target),
        ("cmd.tau_J_d", 0.1 * MOTION.effort),
    ):  # fmt: skip
        columns |= by_joint(f"{stem}[{{}}]", values[:, seven], names)
    pd.DataFrame(columns).to_csv(folder / "log.csv", index=False)
    return folder / "log.csv"


def plotjuggler(folder: Path) -> Path:
    """Its CSV export of joint states whose array it could not name."""
    columns = {"__time": 1.7e9 + MOTION.time, "/joint_states/header/stamp": 1.7e9 + MOTION.time}
    for field in ("position", "velocity", "effort"):
        columns |= by_joint(f"/joint_states/{field}[{{}}]", getattr(MOTION, field), tuple("012"))
    pd.DataFrame(columns).to_csv(folder / "pj.csv", index=False)
    return folder / "pj.csv"


def mj_data(folder: Path) -> Path:
    """Arrays called as in MuJoCo's `mjData`."""
    zeros = np.zeros((COUNT, 3))
    np.savez(
        folder / "ep.npz", time=MOTION.time, qpos=MOTION.position, qvel=MOTION.velocity, qacc=zeros,
        ctrl=MOTION.target, actuator_force=MOTION.effort, qfrc_bias=0.5 * MOTION.effort, qfrc_applied=zeros,
        xpos=np.zeros((COUNT, 5, 3)),
    )  # fmt: skip
    return folder / "ep.npz"


def ur_robot_driver(folder: Path) -> Path:
    """Joint states by name, currents in A as their efforts."""
    store: Any = get_typestore(Stores.ROS2_JAZZY)
    kind, six = "sensor_msgs/msg/JointState", np.resize(np.arange(3), 6)
    with Writer(folder / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        states = writer.add_connection("/joint_states", kind, typestore=store)
        for k in range(COUNT):
            stamp = store.types["builtin_interfaces/msg/Time"](sec=100 + k // 100, nanosec=(k % 100) * 10**7)
            header = store.types["std_msgs/msg/Header"](stamp=stamp, frame_id="")
            values = [values[k, six] for values in (MOTION.position, MOTION.velocity, 0.1 * MOTION.effort)]
            writer.write(
                states, 10**9 + k, store.serialize_cdr(store.types[kind](header, [*UR], *values), kind)
            )
    return folder / "bag"


def franka_ros2(folder: Path) -> Path:
    """Topics of the state broadcaster at 100 Hz, and `/joint_states` with fingers at a fifth of it."""
    store: Any = get_typestore(Stores.ROS2_JAZZY)
    kind, names = "sensor_msgs/msg/JointState", [f"fr3_joint{k}" for k in (1, 2, 3)]
    place = "/franka_robot_state_broadcaster"

    def message(k: int, q: np.ndarray, effort: np.ndarray, fingers: bool = False) -> bytes:
        more = [0.04] if fingers else []
        stamp = store.types["builtin_interfaces/msg/Time"](sec=100 + k // 100, nanosec=(k % 100) * 10_000_000)
        return store.serialize_cdr(
            store.types[kind](
                header=store.types["std_msgs/msg/Header"](stamp=stamp, frame_id=""),
                name=[*names, "fr3_finger_joint1"][: 3 + len(more)], position=np.append(q, more),
                velocity=np.append(MOTION.velocity[k], 0.0 * np.array(more)),
                effort=np.append(effort, 0.0 * np.array(more)),
            ), kind,
        )  # fmt: skip

    with Writer(folder / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = [f"{place}/measured_joint_states", f"{place}/desired_joint_states", "/joint_states"]
        measured, desired, slow = (writer.add_connection(name, kind, typestore=store) for name in topics)
        for k in range(COUNT):
            q, effort = MOTION.position[k], MOTION.effort[k]
            writer.write(measured, 10**9 + k, message(k, q, effort))
            writer.write(desired, 10**9 + k, message(k, MOTION.target[k], 0.1 * effort))
            if k % 5 == 0:
                writer.write(slow, 10**9 + k, message(k, q, effort, fingers=True))
    return folder / "bag"


def plotjuggler_of_two_topics(folder: Path) -> Path:
    """Its CSV export of two topics: rows by time, with empty cells where the other topic's columns are."""
    states = by_joint("/joint_states/{}/position", MOTION.position, JOINTS)
    states |= by_joint("/joint_states/{}/velocity", MOTION.velocity, JOINTS)
    goals = by_joint("/controller_state/reference/{}/position", MOTION.target, JOINTS)
    both = [pd.DataFrame({"__time": 1.7e9 + MOTION.time}, dtype=float).assign(**states)]
    both.append(pd.DataFrame({"__time": 1.7e9 + MOTION.time + 0.003}).assign(**goals))
    pd.concat(both).sort_values("__time").to_csv(folder / "pj.csv", index=False)
    return folder / "pj.csv"


def matlab_rows(folder: Path) -> Path:
    """A row per joint and a column per sample, as MATLAB's users store signals."""
    savemat(folder / "a.mat", {"t": MOTION.time[None, :], "q": MOTION.position.T, "tau": MOTION.effort.T})
    return folder / "a.mat"
