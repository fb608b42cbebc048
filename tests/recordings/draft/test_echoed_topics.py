"""Text of `ros2 topic echo TOPIC > FILE`: joints, poses, trees of frames and a body, as from a bag."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from samrl_core.common.errors import InputError
from samrl_core.diagnosis.residuals.poses.solve import closing_error
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.guess import Effort
from samrl_ros.log_import.draft.writing import as_yaml
from samrl_ros.log_import.formats.echoed_topic import is_echo
from samrl_ros.log_import.formats.transform_tree import read_transform_tree
from samrl_ros.log_import.pose_importer import poses_of
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.tables import read_table

LOST = "A message was lost!!!\n\ttotal count change:3\n\ttotal count: 3---\n"
VIEWS = 12


def header(stamp_ns: int, frame: str, indent: str = "") -> str:
    seconds, rest = divmod(stamp_ns, 1_000_000_000)
    lines = ["header:", "  stamp:", f"    sec: {seconds}", f"    nanosec: {rest}", f"  frame_id: {frame}"]
    return "".join(f"{indent}{line}\n" for line in lines)


def write_pose(kinds: tuple[str, str], pose: np.ndarray, indent: str) -> str:
    turn = Rotation.from_matrix(pose[:3, :3]).as_quat()
    text = ""
    for kind, letters, values in zip(kinds, ("xyz", "xyzw"), (pose[:3, 3], turn), strict=True):
        text += f"{indent}{kind}:\n"
        text += "".join(f"{indent}  {c}: {float(v)!r}\n" for c, v in zip(letters, values, strict=True))
    return text


def chain() -> tuple[np.ndarray, np.ndarray]:
    """Flange in its base, and what it carries in a still camera (VIEWS, 4, 4) [m]."""
    rng = np.random.default_rng(3)
    hand = np.tile(np.eye(4), (VIEWS, 1, 1))
    hand[:, :3, :3] = Rotation.from_rotvec(rng.normal(0.0, 0.5, (VIEWS, 3))).as_matrix()
    hand[:, :3, 3] = [0.4, 0.0, 0.4] + rng.normal(0.0, 0.15, (VIEWS, 3))
    camera, target = np.eye(4), np.eye(4)
    camera[:3, :3] = Rotation.from_rotvec([0.3, 2.0, 0.4]).as_matrix()
    camera[:3, 3], target[:3, 3] = (1.3, 0.1, 0.7), (0.01, -0.02, 0.06)
    return hand, np.linalg.inv(camera) @ hand @ target


def joint_states(count: int) -> list[str]:
    """Two joints at 100 Hz; their position is the sine of the time, and of half of it."""
    text = []
    for k in range(count):
        t = 0.01 * k
        q, v = (np.sin(t), np.sin(0.5 * t)), (np.cos(t), 0.5 * np.cos(0.5 * t))
        lists = {"name": ("a", "b"), "position": q, "velocity": v, "effort": (".nan", ".nan")}
        body = "".join(f"{key}:\n" + "".join(f"- {e}\n" for e in each) for key, each in lists.items())
        text.append(header(10_000_000 * k + 5_000_000_000, "''") + body + "---\n")
    return text


@pytest.mark.parametrize("name", ["states.txt", "states.log", "states.yaml", "states"])
def test_joints_of_an_echo_are_those_of_a_bag(tmp_path: Path, name: str) -> None:
    """Refused before: a table of one column, a file of unknown kind, a YAML of many documents."""
    messages = joint_states(60)
    (tmp_path / name).write_text(LOST + "".join(messages) + messages[-1][:90])
    drafted = draft_any([tmp_path / name], None, None, Effort.ask)
    assert drafted.joints == ["a", "b"] and "part" not in drafted.sources["states"]
    assert drafted.channels["states"]["position"]["unit"] == "rad"
    table = read_table(tmp_path / name, CsvOptions(), "it")
    assert table.time is not None
    np.testing.assert_allclose(table.time, 5.0 + 0.01 * np.arange(60), atol=1e-9)
    np.testing.assert_allclose(table.numbers("position.b", "it"), np.sin(0.005 * np.arange(60)))
    assert any("lost 3 messages" in note for note in table.notes)
    assert any("not whole" in note for note in table.notes)
    assert "log_time" not in table.columns  # no recorder's clock to compare the header's with


def test_echoed_poses_are_paired_by_their_files_and_frames(tmp_path: Path) -> None:
    hand, seen = chain()
    for name, frame, poses in (("tcp", "base_link", hand), ("charuco", "camera_optical_frame", seen)):
        (tmp_path / f"{name}.txt").write_text(
            "".join(
                header(3_000_000_000 * k + 20, frame, "")
                + "pose:\n" + write_pose(("position", "orientation"), pose, "  ") + "---\n"
                for k, pose in enumerate(poses, 1)
            )
        )  # fmt: skip
    drafted = draft_any([tmp_path], None, None)
    assert not drafted.questions and "tool_arm" in drafted.poses
    (made,) = poses_of(as_yaml(drafted), Path("mapping"), tmp_path)
    assert closing_error(made.recording) < 1e-6


def test_an_echoed_tree_of_frames_gives_its_chains(tmp_path: Path) -> None:
    hand, seen = chain()
    text = ""
    for k, poses in enumerate(zip(hand, seen, strict=True), 1):
        text += "transforms:\n"
        for pose, parent, child in zip(poses, ("base_link", "camera"), ("tool0", "tag_3"), strict=True):
            lines = header(3_000_000_000 * k, parent, "  ").replace("  header", "- header", 1)
            text += f"{lines}  child_frame_id: {child}\n  transform:\n"
            text += write_pose(("translation", "rotation"), pose, "    ")
        text += "---\n"
    path = tmp_path / "tf.txt"
    path.write_text(text)
    drafted = draft_any([path], None, None)
    parts = {source["part"] for source in drafted.sources.values()}
    assert parts == {"tag_3 in camera", "tool0 in base_link"} and "tool_arm" in drafted.poses


def test_a_fall_that_ros_1_echoed_is_a_body(tmp_path: Path) -> None:
    """`rostopic echo` writes seq, secs and nsecs, padded, and 1e-05, which YAML 1.1 takes for text."""
    text = "WARNING: topic [/ball] does not appear to be published yet\n"
    for k in range(40):
        t = 0.01 * k
        stamp = f"  stamp: \n    secs: 100\n    nsecs: {10_000_000 * k:>9}\n"
        text += f'header: \n  seq: {k}\n{stamp}  frame_id: "mocap"\n'
        text += f"point: \n  x: {0.3 * t!r}\n  y: 1e-05\n  z: {2.0 - 4.905 * t * t!r}\n---\n"
    (tmp_path / "ball.txt").write_text(text)
    drafted = draft_any([tmp_path / "ball.txt"], None, None)
    assert drafted.kind == "bodies" and drafted.bodies["track"]["unit"] == "m"
    assert (read_table(tmp_path / "ball.txt", CsvOptions(), "it").numbers("point.y", "it") == 1e-5).all()


def test_a_prompt_above_and_frames_of_ros_1_are_read(tmp_path: Path) -> None:
    path = tmp_path / "tf_static.txt"
    stamp = '      stamp: \n        secs: 15\n        nsecs:   4567\n      frame_id: "/base"\n'
    pose = write_pose(("translation", "rotation"), np.eye(4), "      ")
    path.write_text(
        f"me@host:~$ rostopic echo /tf_static\ntransforms: \n  - \n    header: \n      seq: 0\n{stamp}"
        f'    child_frame_id: "tool0"\n    transform: \n{pose}---\n'
    )
    (edge,) = read_transform_tree(path, "it").edges.values()
    assert edge.name == "tool0 in base" and not edge.moves


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("".join(joint_states(2)) + header(1, "a") + "---\n", "one topic"),
        ((header(0, "a") + "---\n") * 2, "no message is stamped.*ros2 bag record"),
        (header(1, "a") + "b: {c\n---\n", "no YAML"),
        (
            header(1, "a") + "b: 1\n---\n" + header(2, "a") + "b: 1nan\n---\n",
            "message 2: b is a text, and a number",
        ),
        (header(1, "a") + "b: {sec: 1nan, nanosec: 0}\n---\n", "b.sec is '1nan', .* no whole number"),
        (header(1, "a") + "---\nhello\n---\n", "message 2 is no message"),
        (header(1, "a") + "---\nheader: " + "[" * 50_000 + "\n---\n", "nested too deeply"),
        (header(1, "a") + "---\nheader: \n" + "- " * 50_000 + "\n---\n", "nested too deeply"),
    ],
    ids=[
        "two topics",
        "no stamps",
        "no YAML",
        "kinds",
        "time",
        "no message",
        "deep in a line",
        "deep in dashes",
    ],
)
def test_an_echo_that_cannot_be_used_is_refused_with_its_reason(tmp_path: Path, text: str, told: str) -> None:
    """Nested too deeply, libyaml would end the process."""
    (tmp_path / "echo.txt").write_text(text)
    with pytest.raises(InputError, match=told):
        read_table(tmp_path / "echo.txt", CsvOptions(), "it")


def test_an_echo_has_no_parts_and_other_text_is_no_echo(tmp_path: Path) -> None:
    path = tmp_path / "states.txt"
    path.write_text("".join(joint_states(3)))
    with pytest.raises(InputError, match="one topic"):
        read_table(path, CsvOptions(), "it", "/joint_states")
    for text in ("time,q\n0,1\n---\n", "header:\n  - a\n---\n", header(1, "a")):
        path.write_text(text)
        assert not is_echo(path)


def test_an_array_that_the_echo_shortened_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "long.txt"
    path.write_text((header(7, "a") + "b: 2\nc:\n- 1.0\n- 2.0\n- '...'\n---\n") * 2)
    table = read_table(path, CsvOptions(), "it")
    assert "c" not in table.columns and table.numbers("b", "it").tolist() == [2.0, 2.0]
    assert any("c left out" in note and "--full-length" in note for note in table.notes)
