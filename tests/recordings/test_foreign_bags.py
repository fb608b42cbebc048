"""Bags that other people's tools make, and bags that are broken."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.common.errors import InputError
from samrl_ros.bags.reader import open_bag
from samrl_ros.bags.writer import BagWriter
from samrl_ros.log_import.draft.blocks import read_parts
from samrl_ros.recordings import load_recordings, write_recording
from samrl_ros.recordings.joint_messages import JOINT_STATE, decode_topic, encode_text, encode_topic

STORE = get_typestore(Stores.ROS2_JAZZY)
STATES = "/cell/tool_arm/joint_states"
STRING = "std_msgs/msg/String"
JOINTS = ("a", "b", "c")
COUNT = 300


def joint_state(stamp_ns: int, names: list[str], position: Any, frame: str = "") -> bytes:
    """As another library serialises it, with no effort."""
    stamp = STORE.types["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    message = STORE.types[JOINT_STATE](
        header=STORE.types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame),
        name=names,
        position=np.asarray(position, float),
        velocity=np.zeros(0),
        effort=np.zeros(0),
    )
    return bytes(STORE.serialize_cdr(message, JOINT_STATE))


@pytest.fixture
def bag(tmp_path: Path) -> Callable[..., Path]:
    """A bag from messages (log time, topic, CDR) and latched texts."""

    def make(messages: list[tuple[int, str, bytes]], **texts: Any) -> Path:
        with BagWriter(tmp_path / "bag") as writer:
            for name, text in texts.items():
                writer.add_topic(f"/cell/tool_arm/{name}", STRING)
                data = text if isinstance(text, str) else json.dumps(text)
                writer.write(f"/cell/tool_arm/{name}", 0, encode_text(data))
            for log_time, topic, data in messages:
                writer.add_topic(topic, JOINT_STATE)
                writer.write(topic, log_time, data)
        return tmp_path / "bag"

    return make


def stream(names: tuple[str, ...] = JOINTS, start: int = 5_000_000_000) -> list[tuple[int, str, bytes]]:
    """States every 10 ms whose log time lags; the value of joint k is k + 0.001 n."""
    number = {name: k for k, name in enumerate("abc")}
    return [
        (
            start + n * 10_000_000 + 3_000_000 + (n % 3) * 900_000,
            STATES,
            joint_state(start + n * 10_000_000, list(names), [number.get(j, 9) + 0.001 * n for j in names]),
        )
        for n in range(COUNT)
    ]


def controller(**more: Any) -> dict[str, Any]:
    return {"joints": list(JOINTS), "stiffness": [1, 2, 3], "damping": [1, 1, 1], **more}


def test_header_stamps_count_not_log_times(bag: Callable[..., Path]) -> None:
    (recording,) = load_recordings(bag(stream())).recordings
    np.testing.assert_allclose(recording.states.time, np.arange(COUNT) * 0.01, atol=1e-9)
    assert recording.arm.joints == JOINTS
    assert recording.states.velocity is None and recording.states.effort is None
    assert recording.command is None and recording.arm.urdf is None and recording.arm.controller is None


def test_joints_are_ordered_as_the_controller_says(bag: Callable[..., Path]) -> None:
    loaded = load_recordings(bag(stream(("finger", "c", "a", "b")), controller=controller()))
    (recording,) = loaded.recordings
    assert recording.arm.joints == JOINTS
    assert recording.states.position is not None
    np.testing.assert_allclose(recording.states.position[0], [0, 1, 2])
    assert any("finger" in note and "ignored" in note for note in loaded.notes["tool_arm"])


def test_an_order_that_changes_within_the_bag(bag: Callable[..., Path]) -> None:
    mixed = [
        b if n % 2 else a for n, (a, b) in enumerate(zip(stream(), stream(("b", "c", "a")), strict=True))
    ]
    (recording,) = load_recordings(bag(mixed)).recordings
    assert recording.states.position is not None
    np.testing.assert_allclose(recording.states.position, np.arange(3) + 0.001 * np.arange(COUNT)[:, None])


def test_gripper_messages_between_those_of_the_arm(bag: Callable[..., Path]) -> None:
    fingers = [(t + 1, STATES, joint_state(t, ["finger"], [0.1])) for t, _, _ in stream()]
    both = sorted(stream() + fingers)
    loaded = load_recordings(bag(both, controller=controller()))
    assert len(loaded.recordings[0].states) == COUNT
    assert any("300 messages of other joints" in note for note in loaded.notes["tool_arm"])


def test_missing_names_are_refused_with_both_lists(bag: Callable[..., Path]) -> None:
    with pytest.raises(InputError, match=r"\['c'\].*\['a', 'b', 'c'\].*\['a', 'b', 'x'\]"):
        load_recordings(bag(stream(("a", "b", "x")), controller=controller()))


def test_a_urdf_of_another_arm_is_refused_with_both_lists(
    bag: Callable[..., Path], motion: ArmRecording
) -> None:
    with pytest.raises(InputError, match=r"'a', 'b', 'c'.*panda_joint1.*wrong URDF"):
        load_recordings(bag(stream(), robot_description=motion.arm.urdf))


def test_a_clock_that_jumps_back(bag: Callable[..., Path]) -> None:
    messages = stream()
    late = [(t + 4_000_000_000, s, joint_state(5_500_000_000 + 10_000_000 * n, list(JOINTS), [0, 0, 0]))
            for n, (t, s, _) in enumerate(stream())]  # fmt: skip
    with pytest.raises(
        InputError, match=r"jumps back by 2\.490000 s at message 300, 2\.99\d* s.*cut the bag"
    ):
        load_recordings(bag(messages + late))


def test_repeated_stamps(bag: Callable[..., Path]) -> None:
    messages = stream()
    messages[100] = (messages[100][0], STATES, messages[99][2])
    loaded = load_recordings(bag(messages))
    assert len(loaded.recordings[0].states) == COUNT - 1
    assert any(
        "stamps repeat, first at message 100" in n and "1 of 300" in n for n in loaded.notes["tool_arm"]
    )


def test_two_publishers_of_one_topic(bag: Callable[..., Path]) -> None:
    messages = stream()
    for n in range(1, COUNT, 2):
        messages[n] = (messages[n][0], STATES, messages[n - 1][2])
    with pytest.raises(InputError, match=r"stamps repeat, first at message 1,.*150 of 300.*one publisher"):
        load_recordings(bag(messages))


def test_unstamped_headers_fall_back_to_log_times_and_say_so(bag: Callable[..., Path]) -> None:
    blank = [(t, s, joint_state(0, list(JOINTS), [n, n, n])) for n, (t, s, _) in enumerate(stream())]
    loaded = load_recordings(bag(blank))
    assert any("log times are used" in note for note in loaded.notes["tool_arm"])
    assert loaded.recordings[0].states.time[1] == pytest.approx(0.0109)


def test_frames_and_padding_that_vary(bag: Callable[..., Path]) -> None:
    odd = [
        (t, s, joint_state(5_000_000_000 + n * 10_000_000, list(JOINTS), [n, 0, 0], f"f{n}") + bytes(n % 4))
        for n, (t, s, _) in enumerate(stream())
    ]
    (recording,) = load_recordings(bag(odd)).recordings
    assert recording.states.position is not None
    np.testing.assert_array_equal(recording.states.position[:, 0], np.arange(COUNT))


def test_big_endian_messages() -> None:
    little = encode_topic(JOINT_STATE, np.array([1_000_000_002]), ["ab"], {"position": np.array([[1.5]])})[0]
    swapped = bytearray(little)
    swapped[1] = 0
    for begin, size in ((4, 4), (8, 4), (12, 4), (20, 4), (24, 4)):
        swapped[begin : begin + size] = swapped[begin : begin + size][::-1]
    rows = decode_topic(JOINT_STATE, "t", [little])
    position = rows.groups[0].values["position"]
    assert rows.stamp_ns[0] == 1_000_000_002 and position[0, 0] == 1.5
    place = little.index(np.float64(1.5).tobytes())
    swapped[place : place + 8] = swapped[place : place + 8][::-1]
    for begin in (place - 4, place + 8, place + 12):
        swapped[begin : begin + 4] = swapped[begin : begin + 4][::-1]
    other = decode_topic(JOINT_STATE, "t", [bytes(swapped)])
    assert other.stamp_ns[0] == 1_000_000_002
    assert other.groups[0].names == ("ab",) and other.groups[0].values["position"][0, 0] == 1.5


@pytest.mark.parametrize("cut", [10, 30, 60])
def test_a_cut_message_is_refused_by_name(cut: int) -> None:
    data = joint_state(0, list(JOINTS), [1, 2, 3])[:cut]
    with pytest.raises(InputError, match=r"topic t, message 1: \d+ bytes"):
        decode_topic(JOINT_STATE, "t", [joint_state(0, list(JOINTS), [1, 2, 3]), data])


def test_effort_of_nan_throughout_counts_as_not_recorded(motion: ArmRecording, tmp_path: Path) -> None:
    assert motion.states.effort is not None
    states = replace(motion.states, effort=np.full_like(motion.states.effort, np.nan))
    loaded = load_recordings(write_recording(replace(motion, states=states), tmp_path / "a.mcap"))
    assert loaded.recordings[0].states.effort is None
    assert any("NaN throughout" in note for note in loaded.notes["tool_arm"])


def test_unknown_keys_are_noted(bag: Callable[..., Path]) -> None:
    text = controller(colour="blue", tolerances={"mass": 0.1, "smell": 1})
    loaded = load_recordings(bag(stream(), controller=text))
    notes = " ".join(loaded.notes["tool_arm"])
    assert "colour" in notes and "smell" in notes
    assert loaded.recordings[0].arm.tolerances.mass == 0.1


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("{", "no JSON"),
        ("[]", "must be an object"),
        ({"joints": list(JOINTS)}, "lacks stiffness, damping"),
        (controller(stiffness=[1, 2]), "stiffness is .* must be 3 finite numbers"),
        (controller(damping=[1, -2, 3]), "must not be negative"),
        (controller(period_s=0), "period_s is"),
        (controller(joints=["a", "a", "b"]), "twice"),
    ],
)
def test_broken_controllers_are_refused(bag: Callable[..., Path], text: Any, what: str) -> None:
    with pytest.raises(InputError, match=what):
        load_recordings(bag(stream(), controller=text))


def test_another_law_is_taken_as_not_described(bag: Callable[..., Path]) -> None:
    loaded = load_recordings(bag(stream(), controller={"type": "position", "joints": list(JOINTS)}))
    assert loaded.recordings[0].arm.controller is None
    assert any("'position'" in note for note in loaded.notes["tool_arm"])


def test_a_bag_without_joint_states_lists_its_topics(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/joint_states", JOINT_STATE)
        writer.write("/joint_states", 1, joint_state(1, ["a"], [0]))
    with pytest.raises(InputError, match=r"no joint states.*/joint_states \(1\).*samrl bag import"):
        load_recordings(tmp_path / "bag")


def test_a_bag_without_a_message_is_said_to_hold_none(tmp_path: Path) -> None:
    """The refusal listed eleven types of messages that the bag might have held."""
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/joint_states", JOINT_STATE)
    with pytest.raises(InputError, match=r"holds no message; name another bag, or record anew"):
        read_parts(tmp_path / "bag", JOINTS)


def test_split_and_unindexed_files(motion: ArmRecording, tmp_path: Path) -> None:
    source = write_recording(motion, tmp_path / "whole")
    bag = open_bag(source)
    writer = BagWriter(tmp_path / "split", "lz4", chunk_bytes=2000)
    for topic in bag.topics:
        writer.add_topic(topic.name, topic.type, topic.qos, topic.definition)
    for number, message in enumerate(bag.messages()):
        if number == 700:
            writer.split()
        writer.write(message.topic, message.log_time_ns, message.data)
    writer.close()
    (tmp_path / "split" / "metadata.yaml").unlink()
    (recording,) = load_recordings(tmp_path / "split").recordings
    np.testing.assert_array_equal(recording.states.position, motion.states.position)


def test_a_truncated_bag_says_what_was_lost(motion: ArmRecording, tmp_path: Path) -> None:
    source = write_recording(motion, tmp_path / "whole")
    bag = open_bag(source)
    writer = BagWriter(tmp_path / "killed", chunk_bytes=4000)
    for topic in bag.topics:
        writer.add_topic(topic.name, topic.type, topic.qos, topic.definition)
    for message in bag.messages():
        writer.write(message.topic, message.log_time_ns, message.data)
    writer.close()
    whole = (tmp_path / "killed" / "killed_0.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) * 2 // 3])
    loaded = load_recordings(tmp_path / "cut.mcap")
    assert 100 < len(loaded.recordings[0].states) < 600
    assert any("truncated" in note and "bytes at the end" in note for note in loaded.notes["tool_arm"])
    (tmp_path / "hopeless.mcap").write_bytes(whole[:200])
    with pytest.raises(InputError, match="no joint states; it is truncated: "):
        load_recordings(tmp_path / "hopeless.mcap")


def test_damage_in_the_middle_of_a_bag_that_looks_whole(motion: ArmRecording, tmp_path: Path) -> None:
    path = write_recording(motion, tmp_path / "whole.mcap")
    bag = open_bag(path)
    writer = BagWriter(tmp_path / "many", chunk_bytes=4000)
    for topic in bag.topics:
        writer.add_topic(topic.name, topic.type, topic.qos, topic.definition)
    for message in bag.messages():
        writer.write(message.topic, message.log_time_ns, message.data)
    writer.close()
    file = tmp_path / "many" / "many_0.mcap"
    damaged = bytearray(file.read_bytes())
    middle = len(damaged) // 2
    damaged[middle : middle + 40] = bytes(40)
    file.write_bytes(damaged)
    loaded = load_recordings(tmp_path / "many")
    assert any("truncated" in note for note in loaded.notes["tool_arm"])
