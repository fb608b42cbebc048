"""Hand-eye pairs out of trees of frames: chains composed, drafted, diagnosed, and trees that are none."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.pose_recording import PoseRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.residuals.poses import rigid
from samrl_ros.cli.main import run
from samrl_ros.log_import.any_importer import import_any
from samrl_ros.log_import.devices import read_devices
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.writing import as_yaml
from samrl_ros.log_import.formats.message_fields import flatten
from samrl_ros.log_import.formats.transform_tree import read_transform_table
from tests.diagnosis.poses.pose_worlds import CAMERA, matrix
from tests.recordings.logs.frame_bags import BEGIN_S, FrameLog, arm_frames, flange_at, write_frames

FLANGE, SEEN = "tool0 in base_link", "tag36h11:7 in camera_color_optical_frame"
ERROR = matrix((0.006, -0.004, 0.005), (0.01, -0.008, 0.006))


def drafted(path: Path) -> Draft:
    return draft_any([path], None, None)


def imported(draft: Draft, folder: Path) -> PoseRecording:
    content = {key: value for key, value in yaml.safe_load(as_yaml(draft)).items() if key != "questions"}
    (folder / "m.yaml").write_text(yaml.safe_dump(content))
    return import_any(folder / "m.yaml", folder, None).made[0].recording


@pytest.mark.parametrize("kind", ["mcap", "sqlite3", "ros1"])
def test_chains_of_every_kind_of_bag_are_sure_and_composed(kind: str, tmp_path: Path) -> None:
    """The camera's place in the flange is what the frames state; nothing is asked."""
    draft = drafted(write_frames(tmp_path / "run", arm_frames(), kind))
    assert draft.kind == "poses" and not draft.questions
    assert {draft.sources["flange"]["part"], draft.sources["target"]["part"]} == {FLANGE, SEEN}
    got = imported(draft, tmp_path)
    assert got.camera_arm is not None and got.camera_arm.flange is not None and got.tool_arm is None
    track = got.camera_arm.flange
    true = flange_at(BEGIN_S + track.time + (0.5 if track.time[0] < 0 else 0.0))
    assert np.allclose(track.position, true[:, :3, 3], atol=2e-6)
    turned = Rotation.from_quat(track.quat_xyzw).inv() * Rotation.from_matrix(true[:, :3, :3])
    assert float(turned.magnitude().max()) < 2e-6
    assert got.camera_in_flange is not None
    assert np.allclose(got.camera_in_flange.position, CAMERA[:3, 3], atol=1e-8)


def test_a_still_camera_is_stated_in_the_base(tmp_path: Path) -> None:
    draft = drafted(write_frames(tmp_path / "run", arm_frames(in_hand=False)))
    assert not draft.questions and "tool_arm" in draft.poses and "camera_in_base" in draft.poses
    assert draft.poses["camera_in_base"]["position"] == pytest.approx([0.9, 0.3, 0.6])


@pytest.mark.parametrize("in_hand", [True, False])
def test_a_camera_without_a_place_is_told_by_what_closes(in_hand: bool, tmp_path: Path) -> None:
    """The camera's driver has a tree of its own: who carries it shows, where it sits nobody states."""
    draft = drafted(write_frames(tmp_path / "run", arm_frames(in_hand, connected=False)))
    assert not draft.questions and ("camera_arm" if in_hand else "tool_arm") in draft.poses
    assert not {"camera_in_flange", "camera_in_base"} & set(draft.poses)
    assert "no frames connect the camera and the arm" in as_yaml(draft)


def test_a_wrong_place_of_the_camera_is_named_in_one_step(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Joints that were recorded beside do not hide what the bag is of."""
    bag = write_frames(tmp_path / "run", arm_frames(error=ERROR), joints=True)
    assert run(["diagnose", str(bag), "--out", str(tmp_path / "report")]) == 0
    said = capsys.readouterr().out
    assert "hand_eye" in said and "no_gap" not in said, said


def test_bags_of_one_chain_are_runs_and_the_last_is_held_out(tmp_path: Path) -> None:
    for name in ("run1", "run2"):
        write_frames(tmp_path / name, arm_frames())
    draft = draft_any([tmp_path / "run1", tmp_path / "run2"], None, None)
    assert [each["role"] for each in draft.recordings] == ["fit", "held_out"]
    assert imported(draft, tmp_path).name == "run1"


def test_transforms_are_interpolated_and_gaps_are_left_out(tmp_path: Path) -> None:
    """Two publishers with stamps of their own, one of them silent for a second."""
    log = arm_frames()
    shifted = [
        (t + (0.003 if any(c == "wrist_3_link" for c, _, _ in rows) else 0.0), rows) for t, rows in log.moving
    ]
    split = [(t, [row]) for t, rows in log.moving for row in rows if row[0] != "wrist_3_link"]
    late = [(t, [row]) for t, rows in shifted for row in rows if row[0] == "wrist_3_link"]
    late = [(t, rows) for t, rows in late if not BEGIN_S + 6 < t < BEGIN_S + 7]
    path = write_frames(tmp_path / "run", FrameLog(moving=sorted(split + late, key=lambda r: r[0])))
    table = read_transform_table(path, "wrist_3_link", "forearm_link", "here")
    assert table.time is not None and len(table.time) == len(late)
    whole = read_transform_table(path, "wrist_3_link", "base_link", "here")
    assert whole.time is not None
    assert not ((whole.time > BEGIN_S + 6.02) & (whole.time < BEGIN_S + 6.98)).any()
    assert any("left out" in note for note in whole.notes)


def test_a_target_in_two_cameras_is_asked_about(tmp_path: Path) -> None:
    log = arm_frames()
    other = [(t + 0.001, [("tag36h11:7", "left_camera", row[2])]) for t, rows in log.moving for row in rows
             if row[0] == "tag36h11:7"]  # fmt: skip
    log = FrameLog(moving=[*log.moving, *other[::2]], static=log.static)
    draft = drafted(write_frames(tmp_path / "run", log))
    assert draft.sources["target"]["part"] == SEEN
    assert any("and not tag36h11:7 in left_camera" in q for q in draft.questions), draft.questions


def test_frames_without_names_are_asked_about(tmp_path: Path) -> None:
    names = {"camera": "zed_left", "target": "cube_7", "mount": "zed"}
    draft = drafted(write_frames(tmp_path / "run", arm_frames(names=names)))
    assert draft.sources["target"]["part"] == "cube_7 in zed_left"
    assert any("as the camera sees it" in q for q in draft.questions), draft.questions


def test_a_target_that_no_camera_sees_is_asked_about_and_hides_no_joints(tmp_path: Path) -> None:
    """Where an arm was sent is a target, too; beside joints it is none of poses."""
    log = arm_frames(in_hand=False, names={"camera": "base_plate", "target": "goal_target"})
    draft = drafted(write_frames(tmp_path / "run", log))
    assert any("is goal_target in base_plate the target" in q for q in draft.questions), draft.questions
    assert read_devices([write_frames(tmp_path / "joints", log, joints=True)], []) is None


def test_a_topic_of_poses_is_seen_beside_the_frames_of_an_arm(tmp_path: Path) -> None:
    """A detector that publishes PoseStamped, and an arm's /tf: the header names the camera's frame."""
    draft = drafted(write_frames(tmp_path / "run", arm_frames(), poses="/aruco_single/pose"))
    assert not draft.questions and draft.sources["target"]["part"] == "/aruco_single/pose"
    assert draft.sources["flange"]["part"] == FLANGE and "camera_in_flange" in draft.poses
    got = imported(draft, tmp_path)
    assert got.camera_in_flange is not None
    assert np.allclose(got.camera_in_flange.position, CAMERA[:3, 3], atol=1e-8)


@dataclass
class Tag:
    id: np.ndarray
    x: float


@dataclass
class Tags:
    detections: list[Tag]


@dataclass
class Markers:
    marker_ids: np.ndarray
    poses: list[Tag]


def test_elements_of_a_list_go_by_their_own_numbers() -> None:
    """`id` within each, as apriltag_ros has it, and `marker_ids` beside the list, as ros2_aruco."""
    seen = [Tag(np.array([7], np.int32), 1.0), Tag(np.array([3], np.int32), 2.0)]
    found = flatten(Tags(seen)) | flatten(Markers(np.array([5, 4]), seen))
    assert (found["detections.7.x"], found["detections.3.x"]) == (1.0, 2.0)
    assert (found["poses.5.x"], found["poses.4.x"]) == (1.0, 2.0)
    twice = [Tag(np.array([7], np.int32), 1.0), Tag(np.array([7], np.int32), 2.0)]
    assert flatten(Tags(twice))["detections.1.x"] == 2.0


@pytest.mark.thorough
@pytest.mark.parametrize("tags", [1, 2])
def test_the_list_of_a_detector_is_read_by_the_numbers_of_its_tags(tags: int, tmp_path: Path) -> None:
    """apriltag_ros' array: tags come in any order, and lists without one are moments without a view."""
    bag = write_frames(tmp_path / "run", arm_frames(noise=0.0), poses="/tag_detections", tags=tags)
    draft = drafted(bag)
    assert draft.sources["target"]["part"] == "/tag_detections"
    assert "camera_in_flange" in draft.poses and draft.sources["flange"]["part"] == FLANGE
    assert any("and not detections" in q for q in draft.questions) == (tags > 1)
    seen = imported(draft, tmp_path).seen
    assert 180 < len(seen.time) < 218, "lists without the tag are left out"
    assert np.abs(np.diff(seen.position, axis=0)).max() < 0.09, "another tag is 0.1 m beside it"


def _turned(log: FrameLog) -> FrameLog:
    """The flange's fixed transform once more, the other way round."""
    child, parent, pose = log.static[0]
    return replace(log, static=[*log.static, (parent, child, np.linalg.inv(pose))])


def _second_parent(log: FrameLog) -> FrameLog:
    child, _, pose = log.static[0]
    return replace(log, static=[*log.static, (child, "world", pose)])


def _run_twice(log: FrameLog) -> FrameLog:
    return replace(log, moving=[*log.moving, *log.moving])


def _hardly_seen(log: FrameLog) -> FrameLog:
    seen = [row for row in log.moving if row[1][0][0] == "tag36h11:7"]
    return replace(log, moving=[row for row in log.moving if row not in seen[3:]])


BROKEN = {
    "loop": (_turned, r"frames go round: .* in .*one root|has 2 parents"),
    "two parents": (_second_parent, r"'tool0' has 2 parents, wrist_3_link and world"),
    "two runs": (_run_twice, r"go back by 1\d.* s .*cut the bag"),
    "hardly seen": (_hardly_seen, r"was recorded 3 times, 6 are the least"),
    "only static": (lambda log: replace(log, moving=[]), r"none moves: record /tf beside /tf_static"),
}


@pytest.mark.parametrize("fault", BROKEN)
def test_trees_that_are_none_are_refused_with_what_to_do(
    fault: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    spoil, said = BROKEN[fault]
    bag = write_frames(tmp_path / "run", spoil(arm_frames()))
    with pytest.raises(InputError, match=said):
        drafted(bag)
    assert run(["bag", "draft", str(bag)]) == 3
    assert "run" in capsys.readouterr().err


def test_a_pose_of_frames_is_a_part_that_a_mapping_names(tmp_path: Path) -> None:
    """A part `CHILD in PARENT`, also up and down the tree; what is not there is named."""
    path = write_frames(tmp_path / "run", arm_frames())
    table = read_transform_table(path, "base_link", "tool0", "here")
    there = read_transform_table(path, "tool0", "base_link", "here")
    both = []
    for each in (table, there):
        numbers = np.column_stack([each.numbers(name, "") for name in list(each.columns)])
        both.append(rigid.transforms(numbers[:, :3], numbers[:, 3:7]))
    assert np.allclose(both[0] @ both[1], np.eye(4), atol=1e-12)
    with pytest.raises(InputError, match=r"no frame 'tool1'; frames are base_link"):
        read_transform_table(path, "tool1", "base_link", "here")
    with pytest.raises(InputError, match="does not move"):
        read_transform_table(path, "camera_link", "tool0", "here")
