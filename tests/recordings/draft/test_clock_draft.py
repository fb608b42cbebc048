"""Stamps as labs log them: which clock is which, what an offset says, counted frames, bags, steps."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from samrl_core.common.errors import InputError
from samrl_ros.cli.main import run
from samrl_ros.log_import.devices import read_devices
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.guess import Draft

EPOCH, COUNT, RATE = 1.7e9, 4000, 30.0
IMU = "sensor_msgs/msg/Imu"


def seconds() -> np.ndarray:
    return np.arange(COUNT) / RATE


def way(rng: np.random.Generator) -> np.ndarray:
    """Time (COUNT,) that messages take [s]."""
    return 0.004 + 0.0008 * rng.gamma(2.0, size=COUNT)


def log(path: Path, form: str = "%.6f", **columns: np.ndarray) -> Path:
    names = ",".join(columns).replace("percent_", "%").replace("__", ".")
    rows = np.stack(list(columns.values()), axis=1)
    np.savetxt(path, rows, delimiter=",", header=names, comments="", fmt=form)
    return path


def report(path: Path, folder: Path) -> dict:
    assert run(["diagnose", str(path), "--out", str(folder)]) == 0
    return json.loads((folder / "report.json").read_text())


def check_drift(found: dict, truth: float) -> None:
    assert found["verdict"] == "effect"
    (effect,) = found["effects"]
    assert effect["family"] == "clock_offset" and set(effect["parameters"]) == {"drift"}
    low, high = effect["parameters"]["drift"]["ci95"]
    assert low < truth < high and high - low < 0.2 * abs(truth)


def test_a_device_that_counts_from_its_own_start_tells_its_rate(tmp_path: Path) -> None:
    t, rng = seconds(), np.random.default_rng(1)
    device = 1e6 * (83.2 + t * (1 - 60e-6))
    path = log(tmp_path / "run.csv", host_time_s=EPOCH + t + way(rng), device_time_us=device)
    check_drift(report(path, tmp_path / "report"), -60e-6)


def test_echoed_headers_are_compared_with_the_time_of_arrival(tmp_path: Path) -> None:
    """`rostopic echo -p`: the way of the messages is no offset of the clocks."""
    t, rng = seconds(), np.random.default_rng(2)
    stamp, came = EPOCH + t * (1 + 50e-6), EPOCH + t + way(rng)
    columns = {"percent_time": 1e9 * came, "field__header__stamp": 1e9 * stamp}
    path = log(tmp_path / "run.csv", "%d", **columns, field__header__seq=np.arange(float(COUNT)))
    check_drift(report(path, tmp_path / "report"), 50e-6)


def test_stamps_without_any_noise_have_a_rate(tmp_path: Path) -> None:
    t = seconds()
    columns = {"host_ns": 1e9 * (EPOCH + t), "sensor_ns": 1e9 * (EPOCH + 0.012 + t * (1 + 35e-6))}
    found = report(log(tmp_path / "run.csv", "%d", **columns), tmp_path / "report")
    (effect,) = found["effects"]
    assert abs(effect["parameters"]["drift"]["value"] - 35e-6) < 2e-6
    assert abs(effect["parameters"]["o"]["value"] - 0.012) < 1e-3


def test_a_clock_that_was_set_is_no_offset_and_told_when(tmp_path: Path) -> None:
    t, rng = seconds(), np.random.default_rng(3)
    device = EPOCH + t * (1 - 80e-6) + 0.25 * (t > 60.0) + 2e-4 * rng.standard_normal(COUNT)
    path = log(tmp_path / "run.csv", host_time=EPOCH + t, sensor_time=device)
    found = report(path, tmp_path / "report")
    assert found["verdict"] == "none_of_mine"
    assert any("step apart by +0.25" in note and "after 60." in note for note in found["notes"])
    (told,) = {n for note in found["notes"] for n in re.findall(r"drift by (\S+) ppm", note)}
    assert abs(float(told) + 80.0) < 3.0


def test_counted_frames_ask_for_the_rate_and_lost_ones_are_no_drift(tmp_path: Path) -> None:
    t, rng = np.arange(COUNT) / 29.97, np.random.default_rng(4)
    kept = rng.uniform(size=COUNT) > 0.07
    columns = {"frame": np.arange(float(COUNT))[kept], "host_time": (EPOCH + t + way(rng))[kept]}
    path = log(tmp_path / "run.csv", **columns)
    with pytest.raises(InputError, match="at how many frames per second is the sensor said to run"):
        read_devices([path], [])
    draft = tmp_path / "mapping.yaml"
    assert run(["bag", "draft", str(path), "--out", str(draft)]) == 0
    text = draft.read_text()
    assert "device / 30 +" in text
    lines = text.splitlines()
    begin = lines.index("questions:")
    draft.write_text("\n".join([*lines[:begin], *lines[begin + 2 :]]))
    assert run(["bag", "import", str(draft), "--out", str(tmp_path / "bags")]) == 0
    check_drift(report(tmp_path / "bags", tmp_path / "report"), 29.97 / 30 - 1)


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_headers_of_a_bag_are_compared_with_its_recorder(tmp_path: Path, plugin: StoragePlugin) -> None:
    path = bag(tmp_path / "imu", plugin, 300e-6, "/imu/data")
    check_drift(report(path, tmp_path / "report"), 300e-6)


def test_of_two_stamped_topics_one_is_asked_for(tmp_path: Path) -> None:
    path = bag(tmp_path / "two", StoragePlugin.MCAP, 0.0, "/imu/data", "/lidar/imu")
    with pytest.raises(InputError, match="is it /imu/data, and not /lidar/imu"):
        read_devices([path], [])


def bag(path: Path, plugin: StoragePlugin, drift: float, *topics: str) -> Path:
    store, rng = get_typestore(Stores.ROS2_HUMBLE), np.random.default_rng(5)
    made = store.types
    zero, one = made["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0), np.zeros(9)
    turn = made["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        for topic in topics:
            connection = writer.add_connection(topic, IMU, typestore=store)
            for t, late in zip(seconds()[:1500], way(rng), strict=False):
                stamp = EPOCH + t * (1 + drift)
                time = made["builtin_interfaces/msg/Time"](int(stamp), int(1e9 * (stamp % 1)))
                header = made["std_msgs/msg/Header"](time, "imu")
                message = made[IMU](header, turn, one, zero, one, zero, one)
                raw = store.serialize_cdr(message, IMU)
                writer.write(connection, int(1e9 * (EPOCH + t + late)), raw)
    return path


def draft_of_ticks(folder: Path, **beside: np.ndarray) -> Draft:
    t, rng = seconds(), np.random.default_rng(9)
    ticks = np.round(125e6 * (12.0 + t))
    arrival = 1e9 * (91234.0 + t + way(rng))
    return draft_any(
        [log(folder / "run.csv", "%.0f", camera_timestamp_ticks=ticks, **beside, pc_receive_ns=arrival)],
        None,
        None,
    )


def test_ticks_of_a_clock_are_no_nanoseconds(tmp_path: Path) -> None:
    """125 MHz at 30 Hz have the steps of a camera at 240 Hz in ns; the column beside says what they are."""
    drafted = draft_of_ticks(tmp_path, camera_tick_hz=np.full(COUNT, 125e6))
    assert drafted.readings["reading"].startswith("device / 125000000 + ") and not drafted.questions


def test_ticks_that_nobody_states_are_asked_for(tmp_path: Path) -> None:
    drafted = draft_of_ticks(tmp_path)
    assert drafted.readings["reading"].startswith("device / 125000000 + ")
    assert any("how many ticks per second" in question for question in drafted.questions)


def test_a_clock_that_runs_a_thousand_times_as_fast_in_its_unit_is_asked_for(tmp_path: Path) -> None:
    t, rng = seconds(), np.random.default_rng(10)
    path = log(tmp_path / "run.csv", host_time_s=EPOCH + t + way(rng), device_time_ms=1e6 * t)
    assert any("in ms?" in question for question in draft_any([path], None, None).questions)
