"""Windows of a stream and their diagnoses: a machine that changes, clocks that restart, what is refused."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.common.errors import InputError
from samrl_ros.bags.qos_metadata import QoS
from samrl_ros.bags.reader import open_bag
from samrl_ros.cli.main import run
from samrl_ros.recordings import load_recordings, write_recording
from samrl_ros.watch.gap_watch import LOG, GapWatch, WatchSettings, lines_of
from samrl_ros.watch.judgement import Judgement
from samrl_ros.watch.windows import Windows, is_diagnosed
from tests.diagnosis.worlds import JOINTS, world
from tests.waiting import wait_for

LATCHED, PLAIN = QoS(durability="transient_local"), QoS()
SECOND = 1_000_000_000
STATES = "/cell/tool_arm/joint_states"
Stream = list[tuple[str, str, QoS, bytes, int]]


def stream(recordings: Sequence[ArmRecording], folder: Path) -> Stream:
    """Messages of recordings, one after the other, as a graph would bring them; stamps go on."""
    made: Stream = []
    start = 100.0
    for k, recording in enumerate(recordings):
        bag = open_bag(write_recording(recording, folder / f"{k}.mcap", start_s=start))
        types = {t.name: t.type for t in bag.topics}
        for m in bag.messages():
            text = types[m.topic].endswith("String")
            if text and k:
                continue  # latched texts come once
            made.append((m.topic, types[m.topic], LATCHED if text else PLAIN, m.data, m.log_time_ns))
        start += float(np.ceil(recording.states.time[-1])) + 0.5
    return made


@pytest.fixture(scope="module")
def changed(tmp_path_factory: pytest.TempPathFactory) -> Stream:
    """Two recordings as described, then one with friction at the lift joint."""
    (plain,) = world(1, "A")
    (other,) = world(1, "B")
    (rubbing,) = world(1, "A", coulomb={JOINTS.index("lift"): 0.8})
    return stream([plain, other, rubbing], tmp_path_factory.mktemp("stream"))


def watched(messages: Stream, settings: WatchSettings) -> tuple[GapWatch, list[Judgement]]:
    """Every message in order; each window's diagnosis is waited for, as if messages came in real time."""
    heard: list[Judgement] = []
    watch = GapWatch(settings, heard.append)

    def settle() -> bool:
        watch.poll()
        return watch._running is None

    for topic, type_name, qos, data, now in messages:
        watch.take(topic, type_name, qos, data, now)
        if watch._running is not None:
            wait_for(settle, "the diagnosis of a window", 0.05)
    return watch, heard


def whole_windows(messages: Stream, folder: Path, length_s: float) -> Iterator[Path]:
    windows = Windows(folder, length_s)
    for topic, type_name, qos, data, now in messages:
        if (ended := windows.take(topic, type_name, qos, data, now)) is not None:
            yield ended.folder
    if (last := windows.end()) is not None:
        yield last.folder


@pytest.mark.thorough
def test_each_window_is_a_bag_of_its_own(changed: Stream, tmp_path: Path) -> None:
    folders = list(whole_windows(changed, tmp_path / "w", 5.0))
    assert len(folders) > 4
    counts = 0
    for folder in folders[:-1]:
        (recording,) = load_recordings(folder).recordings
        assert recording.arm.urdf and recording.arm.controller is not None
        assert 4.0 < recording.duration <= 5.0
        counts += len(recording.states.time)
    counts += len(load_recordings(folders[-1]).recordings[0].states.time)
    assert counts == sum(topic == STATES for topic, *_ in changed)


def test_descriptions_from_before_the_clock_stand_in_each_window(changed: Stream, tmp_path: Path) -> None:
    windows = Windows(tmp_path, 5.0)
    texts = [m for m in changed if m[2].latched]
    for topic, type_name, qos, data, _ in texts:
        windows.describe(topic, type_name, qos, data)
    folders = []
    for message in changed:
        if not message[2].latched and (ended := windows.take(*message)) is not None:
            folders.append(ended.folder)
    assert len(texts) >= 2 and len(folders) >= 3
    for folder in folders:
        assert {m[0] for m in texts} <= {t.name for t in open_bag(folder).topics}


def test_a_clock_that_goes_back_begins_a_new_window(changed: Stream, tmp_path: Path) -> None:
    head = [m for m in changed if m[4] < 104 * SECOND]
    folders = list(whole_windows([*head, *head], tmp_path / "w", 60.0))
    assert len(folders) == 2
    first, second = (load_recordings(f).recordings[0] for f in folders)
    np.testing.assert_array_equal(first.states.time, second.states.time)


@pytest.mark.slow
def test_a_machine_that_changes_is_told_with_the_time(changed: Stream, tmp_path: Path) -> None:
    length = (changed[-1][4] - changed[0][4]) / SECOND / 3
    watch, heard = watched([*changed, (*changed[-1][:4], changed[-1][4] + 60 * SECOND)],
                           WatchSettings(tmp_path, length, keep=1))  # fmt: skip
    assert [j.verdict for j in heard][:1] == ["no_gap"] and heard[-1].verdict == "effect"
    assert heard[-1].effects == ("coulomb_friction@joint:lift",) and heard[-1].places[0] == "joint:lift"
    well, says, values = watch.status()
    assert not well and says == "effect: coulomb_friction@joint:lift"
    assert values["gap since window"] == str(heard[-1].window) and Path(values["report"]).is_file()
    kept = sorted(p.name for p in (tmp_path / "windows").iterdir())
    assert f"{heard[-1].window:04d}" in kept and "0001" not in kept
    written = [json.loads(line)["verdict"] for line in (tmp_path / LOG).read_text().splitlines()]
    assert written == [j.verdict for j in heard]
    assert any("coulomb_friction@joint:lift" in line for line in lines_of(heard[-1]))
    watch.close()


@pytest.mark.slow
def test_an_arm_that_rests_is_not_judged_and_says_so(tmp_path: Path) -> None:
    (plain,) = world(1, "A")
    states = plain.states
    still = replace(states, position=np.broadcast_to(states.position[0], states.position.shape))
    messages = stream([replace(plain, states=still)], tmp_path)
    watch, heard = watched([*messages, (*messages[-1][:4], messages[-1][4] + 60 * SECOND)],
                           WatchSettings(tmp_path / "out", 30.0))  # fmt: skip
    assert [j.verdict for j in heard] == ["refused"] and "moves" in heard[0].says
    well, says, _ = watch.status()
    assert not well and says.startswith("not diagnosed")
    assert lines_of(heard[0])[0].startswith("window 1: not judged")
    watch.close()


def test_a_window_that_ends_while_another_is_diagnosed_is_counted(changed: Stream, tmp_path: Path) -> None:
    watch = GapWatch(WatchSettings(tmp_path, 5.0, keep=0), lambda _: None)
    for topic, type_name, qos, data, now in changed:
        watch.take(topic, type_name, qos, data, now)  # nobody polls
    assert watch.skipped >= 3 and watch.answered == 0
    assert len(list((tmp_path / "windows").iterdir())) == 2  # what is diagnosed, and what is written
    watch.close()


def test_a_window_with_holes_of_our_own_is_not_judged(changed: Stream, tmp_path: Path) -> None:
    heard: list[Judgement] = []
    watch = GapWatch(WatchSettings(tmp_path, 5.0), heard.append)
    for number, (topic, type_name, qos, data, now) in enumerate(changed):
        watch.take(topic, type_name, qos, data, now)
        if number == 2000:
            watch.lose(500)
        if heard:
            break
    assert [j.verdict for j in heard] == ["refused"] and "500 messages were lost" in heard[0].says
    well, says, values = watch.status()
    assert not well and "deeper queue" in says and values["messages lost"] == "500"
    watch.close()


@pytest.mark.parametrize(
    ("topic", "type_name", "taken"),
    [
        ("/joint_states", "sensor_msgs/msg/JointState", True),
        ("/arm_controller/controller_state", "control_msgs/msg/JointTrajectoryControllerState", True),
        ("/robot_description", "std_msgs/msg/String", True),
        ("/cell/tool_arm/tool", "std_msgs/msg/String", True),
        ("/cell/phase", "std_msgs/msg/String", False),
        ("/camera/image_raw", "sensor_msgs/msg/Image", False),
    ],
)
def test_what_a_diagnosis_reads(topic: str, type_name: str, taken: bool) -> None:
    assert is_diagnosed(topic, type_name) == taken


def test_an_earlier_watch_is_not_mixed_in(tmp_path: Path) -> None:
    (tmp_path / "0001").mkdir(parents=True)
    with pytest.raises(InputError, match="another --out"):
        Windows(tmp_path, 30.0)
    with pytest.raises(InputError, match="within 5 and 3600"):
        Windows(tmp_path / "new", 1.0)


@pytest.mark.parametrize("option", [["bag.mcap"], ["--apply"], ["--export", "mujoco"], ["--window", "1"]])
def test_options_that_do_not_fit(
    option: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["diagnose", "--watch", "--out", str(tmp_path / "o"), *option]) == 3
    assert "--w" in capsys.readouterr().err
    assert not (tmp_path / "o").exists()
