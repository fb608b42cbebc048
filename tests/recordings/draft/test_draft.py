"""Drafted mappings of twelve logs of different make: each field right or asked, never wrong in silence."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_ros.log_import.draft.guess import Draft, Effort
from samrl_ros.log_import.draft.joints.joint_draft import draft_mapping
from samrl_ros.log_import.draft.writing import as_yaml
from samrl_ros.log_import.foreign import is_foreign, read_runs
from samrl_ros.log_import.importer import import_recording
from samrl_ros.log_import.mapping import parse_mapping, read_mapping
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.tables import read_table
from tests.recordings.logs.made_logs import (
    JOINTS,
    MOTION,
    NUMBERS,
    aloha_hdf5,
    arrays_npz,
    by_joint,
    camel_csv,
    counts_csv,
    degrees_csv,
    lerobot,
    matlab,
    ros1_bag,
    ros2_bag,
    samples_json,
    short_csv,
    snake_csv,
    urdf_of,
    write_csv,
)

# Log, whether the robot's description is given, and how many questions it leaves (measured, not wished).
LOGS: list[tuple[Callable[[Path], Path], bool]] = [
    (snake_csv, True),
    (degrees_csv, True),
    (short_csv, True),
    (camel_csv, False),
    (counts_csv, False),
    (arrays_npz, True),
    (matlab, False),
    (aloha_hdf5, False),
    (lerobot, False),
    (samples_json, False),
    (ros2_bag, False),
    (ros1_bag, False),
]


def _made(path: Path, described: bool, effort: Effort = Effort.ask) -> Draft:
    return draft_mapping(
        [path], urdf_of(JOINTS) if described else None, "arm.urdf" if described else None, effort
    )


def _wrong_in_silence(draft: Draft, path: Path, folder: Path) -> list[str]:
    """Fields whose values are not those of the motion although nothing was asked about them."""
    (folder / "arm.urdf").write_text(urdf_of(JOINTS))
    text = as_yaml(draft)
    content = (
        text
        if not draft.questions
        else text.replace("questions:", "about:\n  was:", 1).replace("\nabout: D", "\n# D", 1)
    )
    data = (
        path
        if path.is_dir() and not any(s["file"] == path.name for s in draft.sources.values())
        else path.parent
    )
    mapping = parse_mapping(content, folder / "m.yaml")
    recording = import_recording(mapping.recordings[0], mapping, data).recording
    asked = " ".join(draft.questions)
    wrong = []

    def compare(key: str, made: np.ndarray | None, true: np.ndarray, slack: float) -> None:
        if made is not None and key not in asked and not np.allclose(made, true, atol=slack):
            wrong.append(f"{key}: off by {np.abs(made - true).max():.3g}")

    if "time" not in asked:
        compare("sources.states.time", recording.states.time, MOTION.time, 1e-6)
    if recording.arm.joints != JOINTS and not all(each.startswith("joint_") for each in recording.arm.joints):
        wrong.append(f"joints: {recording.arm.joints}")
    compare("channels.states.position", recording.states.position, MOTION.position, 2e-3)
    if "channels.states.position" not in asked and "time" not in asked:
        compare("channels.states.velocity", recording.states.velocity, MOTION.velocity, 0.2)
    if recording.command is not None:
        position = (
            "channels.command.position" if "channels.states.position" not in asked else "states.position"
        )
        compare(position, recording.command.position, MOTION.target, 2e-3)
    if recording.commanded_effort is not None:
        compare("channels.commanded_effort.effort", recording.commanded_effort.effort, MOTION.effort, 1e-6)
    if recording.states.effort is not None:
        compare("channels.states.effort", recording.states.effort, MOTION.effort, 1e-6)
    return wrong


@pytest.mark.parametrize(("make", "described"), LOGS, ids=[make.__name__ for make, _ in LOGS])  # ty: ignore[missing-attribute]
def test_nothing_is_wrong_in_silence(make: Callable[[Path], Path], described: bool, tmp_path: Path) -> None:
    path = make(tmp_path)
    draft = _made(path, described)
    assert not _wrong_in_silence(draft, path, tmp_path)
    assert draft.channels["states"]["position"]
    (tmp_path / "m.yaml").write_text(as_yaml(draft))
    if draft.questions:
        with pytest.raises(InputError, match="questions of its draft are open"):
            read_mapping(tmp_path / "m.yaml")
    else:
        read_mapping(tmp_path / "m.yaml")


def test_what_each_log_leaves_to_ask(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = {}
    for make, described in LOGS:
        folder = tmp_path / make.__name__  # ty: ignore[missing-attribute]
        folder.mkdir()
        draft = _made(make(folder), described)
        table[make.__name__] = sorted({question.split(":")[0] for question in draft.questions})  # ty: ignore[missing-attribute]
        assert ("command" in draft.channels) == (make not in (short_csv, ros1_bag)), make.__name__  # ty: ignore[missing-attribute]
    with capsys.disabled():
        for name, asked in table.items():
            print(f"\n{name}: {', '.join(asked) or 'nothing'}", end="")
    assert table["snake_csv"] == ["channels.commanded_effort.effort"]
    assert table["ros2_bag"] == table["ros1_bag"] == ["channels.commanded_effort.effort"]
    assert table["degrees_csv"] == ["joints"]


def test_files_with_the_same_columns_are_recordings_of_one_machine(tmp_path: Path) -> None:
    folder = tmp_path / "bench"
    folder.mkdir()
    time = np.arange(0.0, 8.0, 0.01)
    for k, name in enumerate(("slow", "swift", "work")):
        goal = 100.0 * np.sin((1.0 + k) * time)
        force = 3.0 * np.cos(time)
        rate = 100.0 * (1.0 + k) * np.cos((1.0 + k) * time)
        rows = np.column_stack([time, goal, goal + 0.01 * np.sin(9 * time), rate, force])
        head = "Time[s],Target[mm],Actual[mm],Velocity[mm/s],Force[N]"
        np.savetxt(folder / f"{name}.csv", rows, delimiter=",", header=head, comments="", fmt="%.6f")
    (folder / "params.yaml").write_text("rate: 100\n")  # settings beside logs are no recording
    draft = draft_mapping([folder], None, None)
    assert [(r["name"], r["role"]) for r in draft.recordings] == [
        ("slow", "fit"), ("swift", "fit"), ("work", "held_out"),
    ]  # fmt: skip
    assert not any("and not" in question for question in draft.questions)
    # A velocity that is not called `actual` beside an actual position is the measured one all the same.
    assert draft.channels["states"]["velocity"]["formula"] == ["velocity_mm_s_1"]
    assert draft.channels["commanded_effort"]["effort"]["formula"] == ["force_n_1"]
    text = as_yaml(draft).replace("questions:", "about:\n  was:", 1).replace("\nabout: D", "\n# D", 1)
    mapping = parse_mapping(text, folder / "m.yaml")
    positions = [import_recording(r, mapping, folder).recording.states.position for r in mapping.recordings]
    assert [np.ptp(p) for p in positions] == pytest.approx([0.2] * 3, rel=0.01)
    with pytest.raises(InputError, match=r"several recordings \(slow, swift, work\)"):
        read_runs(folder, None, None, Effort.none)


def test_efforts_that_are_stated_leave_nothing_to_ask(tmp_path: Path) -> None:
    path = ros2_bag(tmp_path)
    for effort in (Effort.drive, Effort.link, Effort.none):
        draft = _made(path, False, effort)
        assert not draft.questions
        assert ("effort" in draft.channels["states"]) == (effort is Effort.link)
        assert ("commanded_effort" in draft.channels) == (effort is Effort.drive)


def test_a_foreign_bag_is_read_without_a_mapping(tmp_path: Path) -> None:
    path = ros2_bag(tmp_path)
    assert is_foreign(path)
    (recording,), notes = read_runs(path, None, None, Effort.link)
    assert recording.arm.joints == JOINTS
    assert recording.command is not None
    np.testing.assert_allclose(recording.states.position, MOTION.position)
    np.testing.assert_allclose(recording.states.effort, MOTION.effort)
    np.testing.assert_allclose(recording.command.position, MOTION.target)
    assert any("channels.states.effort: /joint_states" in note for note in notes)
    with pytest.raises(InputError, match=r"not all of it is sure:\n  channels.commanded_effort"):
        read_runs(path, None, None, Effort.ask)


def test_numbered_columns_stand_beside_named_ones(tmp_path: Path) -> None:
    names = tuple(f"joint_{k}" for k in NUMBERS)
    columns = {"t": MOTION.time, **by_joint("{}_rad", MOTION.position, names)}
    columns |= by_joint("dq{}", MOTION.velocity, NUMBERS) | by_joint("tau{}_Nm", MOTION.effort, NUMBERS)
    path = write_csv(tmp_path / "a.csv", columns)
    draft = draft_mapping([path], urdf_of(names), "arm.urdf", Effort.drive)
    assert not draft.unused and not draft.questions
    assert draft.channels["states"]["velocity"] != "derivative"
    assert draft.channels["commanded_effort"]["effort"]["unit"] == "N m"


def test_a_velocity_that_is_none_is_not_taken(tmp_path: Path) -> None:
    columns = {"t": MOTION.time, **by_joint("pos_rad{}", MOTION.position, NUMBERS)}
    path = write_csv(tmp_path / "a.csv", columns | by_joint("vel{}", MOTION.effort, NUMBERS))
    draft = _made(path, False)
    assert draft.channels["states"]["velocity"] == "derivative"
    assert "is not its rate" in as_yaml(draft)


def test_a_log_without_positions_is_refused(tmp_path: Path) -> None:
    path = write_csv(
        tmp_path / "a.csv", {"t": MOTION.time, "temperature": MOTION.time, "fan": MOTION.time**2}
    )
    with pytest.raises(InputError, match=r"no measured position was found among .*temperature"):
        _made(path, False)


def test_a_folder_of_settings_alone_is_refused(tmp_path: Path) -> None:
    (tmp_path / "params.yaml").write_text("rate: 100\n")
    (tmp_path / "weights.pt").write_text("x")
    told = r"none of the folder's 2 files can be read as a log; params\.yaml: .*; weights\.pt: "
    with pytest.raises(InputError, match=told):
        draft_mapping([tmp_path], None, None)


def test_a_ros1_bag_with_a_damaged_message_is_refused(tmp_path: Path) -> None:
    """Its reader opens: the index is whole, and only the messages tell."""
    path = ros1_bag(tmp_path)
    data = path.read_bytes()
    at = data.rindex(b"\x04\x00\x00\x00op=\x02")  # of a message in its chunk: the length of a header's field
    path.write_bytes(data[:at] + b"\xff\xff\x00\x00" + data[at + 4 :])
    with pytest.raises(InputError, match="does not fit its type|cannot be read"):
        read_table(path, CsvOptions(), "it", "/joint_states")
