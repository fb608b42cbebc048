"""One motion of three joints as logs of twelve makes: the columns, units and files that others write."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.io import savemat

from samrl_ros.log_import.formats.control_msgs import RELEASES

RATE = 100.0
COUNT = 600
JOINTS = ("shoulder", "elbow", "wrist")
STATE = "control_msgs/msg/JointTrajectoryControllerState"


@dataclass(frozen=True, eq=False)
class Motion:
    """What really happened: SI units, joints in the order of JOINTS."""

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    target: np.ndarray
    effort: np.ndarray


def _motion() -> Motion:
    time = np.arange(COUNT) / RATE
    phase = np.outer(time, [2.1, 3.3, 4.7]) + [0.0, 0.4, 1.1]
    size = np.array([0.9, 0.6, 0.5])
    lag = np.outer(np.ones(COUNT), [0.02, 0.01, 0.015])
    return Motion(
        time,
        size * np.sin(phase),
        size * np.array([2.1, 3.3, 4.7]) * np.cos(phase),
        size * np.sin(phase) + lag,
        4.0 * np.cos(phase) + np.array([1.0, -2.0, 0.3]),
    )


MOTION = _motion()


def urdf_of(names: tuple[str, ...]) -> str:
    links = "".join(f'<link name="l{k}"/>' for k in range(len(names) + 1))
    joints = "".join(
        f'<joint name="{name}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/>'
        '<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="50" velocity="9"/></joint>'
        for k, name in enumerate(names)
    )
    return f'<robot name="r">{links}{joints}</robot>'


def write_csv(path: Path, columns: dict[str, np.ndarray]) -> Path:
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(columns)
        writer.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))
    return path


def by_joint(pattern: str, values: np.ndarray, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    return {pattern.format(name): values[:, k] for k, name in enumerate(names)}


NUMBERS = ("1", "2", "3")


def snake_csv(folder: Path) -> Path:
    m = MOTION
    columns = {"time_s": m.time, **by_joint("{}_position_rad", m.position, JOINTS)}
    columns |= by_joint("{}_velocity", m.velocity, JOINTS) | by_joint("{}_target_position", m.target, JOINTS)
    return write_csv(folder / "run.csv", columns | by_joint("{}_torque_nm", m.effort, JOINTS))


def degrees_csv(folder: Path) -> Path:
    m = MOTION
    columns = {"timestamp_ms": 1e3 * m.time, **by_joint("actual_q_deg{}", np.degrees(m.position), NUMBERS)}
    columns |= by_joint("actual_qd{}", m.velocity, NUMBERS)
    return write_csv(folder / "ur.csv", columns | by_joint("target_q_deg{}", np.degrees(m.target), NUMBERS))


def short_csv(folder: Path) -> Path:
    m = MOTION
    columns = {"t": m.time, **by_joint("q{}", m.position, NUMBERS), **by_joint("dq{}", m.velocity, NUMBERS)}
    return write_csv(folder / "short.csv", columns | by_joint("tau{}", m.effort, NUMBERS))


def camel_csv(folder: Path) -> Path:
    m = MOTION
    columns = {"TimeStamp": 1e6 * m.time, **by_joint("ActualPosition{}", m.position, NUMBERS)}
    return write_csv(folder / "plc.csv", columns | by_joint("CommandPosition{}", m.target, NUMBERS))


def counts_csv(folder: Path) -> Path:
    counts = np.round(2048 + MOTION.position * 4096 / (2 * np.pi))
    goals = np.round(2048 + MOTION.target * 4096 / (2 * np.pi))
    columns = {"t": MOTION.time, **by_joint("present_position_{}", counts, NUMBERS)}
    return write_csv(folder / "servo.csv", columns | by_joint("goal_position_{}", goals, NUMBERS))


def arrays_npz(folder: Path) -> Path:
    m = MOTION
    np.savez(folder / "a.npz", t=m.time, qpos=m.position, qvel=m.velocity, tau=m.effort, target_q=m.target)
    return folder / "a.npz"


def matlab(folder: Path) -> Path:
    m = MOTION
    savemat(folder / "a.mat", {"log": {"time": m.time, "q_meas": m.position, "q_ref": m.target}})
    return folder / "a.mat"


def aloha_hdf5(folder: Path) -> Path:
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "a.hdf5", "w") as file:
        file["observations/qpos"], file["observations/qvel"] = MOTION.position, MOTION.velocity
        file["action"] = MOTION.target
    return folder / "a.hdf5"


def lerobot(folder: Path) -> Path:
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet as parquet

    path = folder / "set"
    (path / "meta").mkdir(parents=True)
    (path / "data/chunk-000").mkdir(parents=True)
    names = [f"{joint}.pos" for joint in JOINTS]
    features = {key: {"names": names} for key in ("observation.state", "action")}
    (path / "meta/info.json").write_text(json.dumps({"total_episodes": 1, "features": features}))
    columns = {
        "observation.state": np.degrees(MOTION.position).tolist(),
        "action": np.degrees(MOTION.target).tolist(),
        "timestamp": MOTION.time.tolist(),
        "frame_index": list(range(COUNT)),
        "episode_index": [0] * COUNT,
    }
    parquet.write_table(pa.table(columns), path / "data/chunk-000/file-000.parquet")
    return path


def samples_json(folder: Path) -> Path:
    samples = [
        {"time": t, "state": {"position": q, "velocity": v}, "command": {"position": d}}
        for t, q, v, d in zip(
            MOTION.time.tolist(),
            MOTION.position.tolist(),
            MOTION.velocity.tolist(),
            MOTION.target.tolist(),
            strict=True,
        )
    ]
    (folder / "a.json").write_text(json.dumps(samples))
    return folder / "a.json"


def _header(store: Any, k: int, ros1: bool) -> Any:
    stamp = store.types["builtin_interfaces/msg/Time"](sec=100 + k // 100, nanosec=(k % 100) * 10_000_000)
    return store.types["std_msgs/msg/Header"](stamp=stamp, frame_id="", **({"seq": k} if ros1 else {}))


def _bag(path: Path, ros1: bool, late: int = 0) -> Path:
    """Joint states in the URDF's wrong order beside a gripper, a controller's state, a description.

    `late` samples turn the motion round, so that recordings differ.
    """
    motion = Motion(MOTION.time, *(np.roll(values, late, axis=0) for values in (
        MOTION.position, MOTION.velocity, MOTION.target, MOTION.effort)))  # fmt: skip
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_JAZZY)
    if not ros1:
        for name, text in RELEASES[2].items():
            store.register(get_types_from_msg(text, name))
    writer: Any = Writer1(path) if ros1 else Writer2(path, version=9, storage_plugin=StoragePlugin.MCAP)
    encode: Callable[[Any, str], Any] = store.serialize_ros1 if ros1 else store.serialize_cdr
    order = [2, 0, 1]
    with writer:
        states = writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
        about = writer.add_connection("/robot_description", "std_msgs/msg/String", typestore=store)
        text = store.types["std_msgs/msg/String"](data=urdf_of(JOINTS))
        writer.write(about, 1, encode(text, "std_msgs/msg/String"))
        control = (
            None
            if ros1
            else writer.add_connection("/arm_controller/controller_state", STATE, typestore=store)
        )
        for k in range(COUNT):
            message = store.types["sensor_msgs/msg/JointState"](
                header=_header(store, k, ros1),
                name=[*(JOINTS[i] for i in order), "finger"],
                position=np.append(motion.position[k, order], 0.04),
                velocity=np.append(motion.velocity[k, order], 0.0),
                effort=np.append(motion.effort[k, order], 0.0),
            )
            writer.write(states, 10**9 + k, encode(message, "sensor_msgs/msg/JointState"))
            if control is not None:
                writer.write(control, 10**9 + k, store.serialize_cdr(_state(store, k, motion), STATE))
    return path


def _state(store: Any, k: int, motion: Motion = MOTION) -> Any:
    point = store.types["trajectory_msgs/msg/JointTrajectoryPoint"]
    free = store.types["trajectory_msgs/msg/MultiDOFJointTrajectoryPoint"]
    none = store.types["builtin_interfaces/msg/Duration"](sec=0, nanosec=0)
    empty = np.array([])
    values = {"reference": motion.target[k], "feedback": motion.position[k]}
    points = {
        name: point(values.get(name, np.zeros(3)), empty, empty, empty, none)
        for name in ("reference", "feedback", "error", "output")
    }
    frees = {f"multi_dof_{name}": free([], [], [], none) for name in points}
    return store.types[STATE](
        header=_header(store, k, False), joint_names=[*JOINTS], multi_dof_joint_names=[], **points, **frees
    )


def ros2_bag(folder: Path, late: int = 0) -> Path:
    return _bag(folder / "bag", ros1=False, late=late)


def ros1_bag(folder: Path, late: int = 0) -> Path:
    return _bag(folder / "a.bag", ros1=True, late=late)
