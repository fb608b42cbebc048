"""Logs as other tools write them, each small and sound: what damage starts from."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore
from scipy.io import savemat

COUNT = 220  # samples of a recording, enough for its checks


def columns() -> dict[str, np.ndarray]:
    """Time [s] and a joint's position [rad]."""
    time = np.arange(COUNT) * 0.01
    return {"t": time, "q": 0.3 * np.sin(6 * time)}


def write_csv() -> bytes:
    """As text."""
    rows = ["t,q", *(f"{t:.4f},{q:.6f}" for t, q in zip(*columns().values(), strict=True))]
    return "\n".join(rows).encode()


def write_joint_rows() -> bytes:
    """As text with a row per joint."""
    rows = [
        f"{t:.4f},{axis},{q:.6f}" for t, q in zip(*columns().values(), strict=True) for axis in ("J1", "J2")
    ]
    return "\n".join(["t,axis,q", *rows]).encode()


def write_messages() -> bytes:
    """As Python's csv writes messages: names and numbers of two joints in a cell each."""
    rows = [
        f"{t:.4f},\"['a', 'b']\",\"array('d', [{q:.5f}, {-q:.5f}])\""
        for t, q in zip(*columns().values(), strict=True)
    ]
    return "\n".join(["t,name,position", *rows]).encode()


def write_teleplot() -> bytes:
    """As lines of Teleplot."""
    return "\n".join(f">q:{1e3 * t:.0f}:{q:.6f}" for t, q in zip(*columns().values(), strict=True)).encode()


def write_npz() -> bytes:
    """As NumPy's archive."""
    buffer = io.BytesIO()
    np.savez(buffer, **columns())
    return buffer.getvalue()


def write_mat() -> bytes:
    """As MATLAB's file of version 5, with a structure."""
    buffer = io.BytesIO()
    savemat(buffer, {"log": {"t": columns()["t"], "q": columns()["q"]}, "x": np.eye(3)})
    return buffer.getvalue()


def write_hdf5() -> bytes:
    """As HDF5, with a group."""
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        file["log/q"], file["log/t"] = np.ones((COUNT, 2)), columns()["t"]
    return buffer.getvalue()


def write_parquet() -> bytes:
    """As Parquet, with a column of lists and one of texts."""
    buffer = io.BytesIO()
    pq.write_table(pa.table({**columns(), "list": [[1.0, 2.0]] * COUNT, "text": ["a"] * COUNT}), buffer)
    return buffer.getvalue()


@cache
def _ros_bag_files(name: str) -> dict[str, bytes]:
    """A bag of a few joint states as rosbags writes it."""
    ros1 = name.endswith(".bag")
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_JAZZY)
    stamp = store.types["builtin_interfaces/msg/Time"](sec=1, nanosec=2)
    header = store.types["std_msgs/msg/Header"](stamp=stamp, frame_id="", **({"seq": 1} if ros1 else {}))
    ones = np.ones(2)
    message = store.types["sensor_msgs/msg/JointState"](header, ["a", "b"], ones, ones, np.array([]))
    encode: Callable[[Any, str], Any] = store.serialize_ros1 if ros1 else store.serialize_cdr
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        writer: Any = (
            Writer1(path) if ros1 else Writer2(path, version=9, storage_plugin=StoragePlugin.SQLITE3)
        )
        with writer:
            to = writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
            for k in range(3):
                writer.write(to, k + 1, encode(message, "sensor_msgs/msg/JointState"))
        files = [path] if ros1 else sorted(path.iterdir())
        return {file.name: file.read_bytes() for file in files}


def write_ros_bag(name: str) -> bytes:
    """A ROS 1 bag (`*.bag`), or the database of a ROS 2 bag."""
    files = _ros_bag_files(name)
    return files[name if name.endswith(".bag") else f"{name}.db3"]


def write_ros_metadata() -> bytes:
    """`metadata.yaml` of the ROS 2 bag."""
    return _ros_bag_files("log")["metadata.yaml"]


def put_metadata_beside(path: Path) -> None:
    """In a folder of the bag, where its database will be."""
    path.parent.mkdir()
    (path.parent / "metadata.yaml").write_bytes(write_ros_metadata())
