"""Bags of two machines with the same topics in one folder: what tells them apart is asked."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from samrl_core.common.errors import InputError
from samrl_core.diagnosis.nominal_model.read_model import read_model
from samrl_ros.cli.diagnosis.load import load
from samrl_ros.cli.diagnosis.options import DiagnoseOptions
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.guess import Draft, Effort
from tests.recordings.logs.made_logs import JOINTS, MOTION, urdf_of

TODAY = 1_790_000_000 * 10**9  # [ns]
MINUTE = 60 * 10**9  # [ns]


def record(
    path: Path, begin: int, rate: float = 100.0, names: tuple[str, ...] = JOINTS, text: str = urdf_of(JOINTS)
) -> None:
    """A bag of joint states of 6 s at 100 Hz, after its machine's description."""
    store = get_typestore(Stores.ROS2_JAZZY)
    stamp, header = store.types["builtin_interfaces/msg/Time"], store.types["std_msgs/msg/Header"]
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        to: Any = writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
        about: Any = writer.add_connection("/robot_description", "std_msgs/msg/String", typestore=store)
        described = store.types["std_msgs/msg/String"](data=text)
        writer.write(about, begin, bytes(store.serialize_cdr(described, "std_msgs/msg/String")))
        for k in range(len(MOTION.time)):
            now = begin + round(1e9 * k / rate)
            message = store.types["sensor_msgs/msg/JointState"](
                header=header(stamp=stamp(sec=now // 10**9, nanosec=now % 10**9), frame_id=""),
                name=list(names),
                position=MOTION.position[k],
                velocity=MOTION.velocity[k] * rate / 100.0,
                effort=MOTION.effort[k],
            )
            writer.write(to, now, bytes(store.serialize_cdr(message, "sensor_msgs/msg/JointState")))


def drafted(place: Path) -> Draft:
    return draft_any([place], urdf_of(JOINTS), "arm.urdf", Effort.drive)


def asked(draft: Draft) -> list[str]:
    return [guess.question for guess in draft.of("recordings") if guess.question]


@pytest.mark.parametrize("begin", [TODAY, 0], ids=["by the clock", "simulated, from zero"])
def test_recordings_of_one_machine_ask_nothing(begin: int, tmp_path: Path) -> None:
    """One after another; simulated ones all begin at zero, and text that differs in spaces is the same."""
    record(tmp_path / "a", begin)
    record(tmp_path / "b", begin + (MINUTE if begin else 0), text=urdf_of(JOINTS).replace("><", ">\n  <"))
    record(tmp_path / "c", begin + (2 * MINUTE if begin else 0), rate=110.0)
    draft = drafted(tmp_path)
    assert not asked(draft)
    assert [each["name"] for each in draft.recordings] == ["a", "b", "c"]


@pytest.mark.parametrize(
    ("of_other", "said"),
    [
        ({"begin": TODAY + 2 * 10**9}, "b and a were recorded at once, for 3.99 s"),
        ({"begin": TODAY + MINUTE, "rate": 500.0}, "/joint_states comes at 500 Hz in b, at 100 Hz in a"),
        (
            {"begin": TODAY + MINUTE, "text": urdf_of(JOINTS).replace("50", "51")},
            "b and a differ in /robot_description",
        ),
    ],
)
def test_what_speaks_against_one_machine_is_asked(
    of_other: dict[str, Any], said: str, tmp_path: Path
) -> None:
    record(tmp_path / "a", TODAY)
    record(tmp_path / "b", **of_other)
    (question,) = asked(drafted(tmp_path))
    assert question.startswith("are all of one machine?")
    assert said in question
    (tmp_path / "arm.urdf").write_text(urdf_of(JOINTS))
    options = DiagnoseOptions((tmp_path,), urdf=tmp_path / "arm.urdf", effort=Effort.drive)
    with pytest.raises(InputError, match=r"one machine.*delete that question"):
        load(options, read_model(tmp_path / "arm.urdf"))


def test_a_bag_with_other_joints_is_left_out_and_named(tmp_path: Path) -> None:
    record(tmp_path / "a", TODAY)
    record(tmp_path / "b", TODAY + MINUTE, names=("elbow_2", *JOINTS[1:]))
    record(tmp_path / "c", TODAY + 2 * MINUTE)
    draft = drafted(tmp_path)
    assert [(each["name"], each["role"]) for each in draft.recordings] == [("a", "fit"), ("c", "held_out")]
    assert f"b: names no {JOINTS[0]}, so it is another machine's" in draft.unused


def test_of_many_differences_the_first_are_said(tmp_path: Path) -> None:
    for k in range(4):
        record(tmp_path / f"r{k}", TODAY + k * 10**9)
    (question,) = asked(drafted(tmp_path))
    assert question.count("recorded at once") == 3
    assert "and 3 more such pairs" in question
