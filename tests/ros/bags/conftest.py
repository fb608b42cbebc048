"""Messages and bags for these tests."""

from __future__ import annotations

import os
import struct
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from samrl_ros.bags.qos_metadata import QoS
from samrl_ros.bags.writer import BagWriter

STRING = "std_msgs/msg/String"
JOINTS = "sensor_msgs/msg/JointState"
IMAGE = "sensor_msgs/msg/Image"
ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="session")
def typestore() -> Any:
    return get_typestore(Stores.ROS2_JAZZY)


@pytest.fixture(scope="session")
def string_cdr() -> Callable[[str], bytes]:
    def make(text: str) -> bytes:
        data = text.encode() + b"\0"
        return b"\0\1\0\0" + struct.pack("<I", len(data)) + data

    return make


@pytest.fixture(scope="session")
def joints_cdr(typestore: Any) -> Callable[[int, float], bytes]:
    kinds = typestore.types

    def make(stamp_ns: int, value: float) -> bytes:
        stamp = kinds["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
        message = kinds[JOINTS](
            header=kinds["std_msgs/msg/Header"](stamp=stamp, frame_id=""),
            name=[f"panda_joint{i}" for i in range(1, 8)],
            position=np.full(7, value),
            velocity=np.zeros(7),
            effort=np.zeros(7),
        )
        return bytes(typestore.serialize_cdr(message, JOINTS))

    return make


@pytest.fixture
def small_bag(
    tmp_path: Path, string_cdr: Callable[[str], bytes], joints_cdr: Callable[[int, float], bytes]
) -> Callable[..., Path]:
    """Writes 200 messages in many chunks: one latched text, joint states and phases."""

    def make(name: str = "small", compression: str = "zstd", close: bool = True, **kwargs: Any) -> Path:
        writer = BagWriter(
            tmp_path / name, compression, chunk_bytes=4096, custom_data={"task": "peg_insertion"}, **kwargs
        )
        writer.add_topic("/cell/tool_arm/tool", STRING, QoS(durability="transient_local", depth=1))
        writer.add_topic("/cell/tool_arm/joint_states", JOINTS)
        writer.add_topic("/cell/phase", STRING, QoS(reliability="best_effort", depth=5))
        writer.write("/cell/tool_arm/tool", 1_000_000, string_cdr("{}"))
        for i in range(1, 200):
            now = (i + 1) * 1_000_000
            if i % 10 == 0:
                writer.write("/cell/phase", now, string_cdr(f"phase {i}"))
            else:
                writer.write("/cell/tool_arm/joint_states", now, joints_cdr(now - 500, 0.01 * i), now - 500)
        if close:
            writer.close()
        else:
            writer.flush()
        return tmp_path / name

    return make


@pytest.fixture
def child_environment() -> Iterator[dict[str, str]]:
    """Environment in which a child process finds this source tree."""
    yield {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *filter(None, sys.path)])}
