"""Files of pose pairs as calibration tools write them: OpenCV, MoveIt, easy_handeye, rows that take turns."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
import yaml
from scipy.spatial.transform import Rotation

from samrl_core.common.errors import InputError
from samrl_ros.cli.main import run
from samrl_ros.log_import.any_importer import import_any
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.tracks.logged_tracks import read_logged_tables
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.tables import read_table

VIEWS = 14


def poses() -> tuple[np.ndarray, np.ndarray]:
    """The board in the camera and the hand in the base (N, 4, 4), of a camera on the hand."""
    rng = np.random.default_rng(3)
    board, eye = np.eye(4), np.eye(4)
    board[:3, :3], board[:3, 3] = Rotation.from_euler("xyz", [0.1, 3.0, 0.4]).as_matrix(), [0.5, 0.1, 0.0]
    eye[:3, :3], eye[:3, 3] = Rotation.from_euler("xyz", [0.1, 0.2, 1.5]).as_matrix(), [0.05, 0.02, 0.07]
    hand = np.tile(np.eye(4), (VIEWS, 1, 1))
    hand[:, :3, :3] = Rotation.from_rotvec(rng.uniform(-0.6, 0.6, (VIEWS, 3))).as_matrix()
    hand[:, :3, 3] = rng.uniform(-0.2, 0.2, (VIEWS, 3)) + [0.4, 0.0, 0.5]
    return np.linalg.inv(hand @ eye) @ board, hand


def opencv(folder: Path, seen: np.ndarray, hand: np.ndarray) -> Path:
    lines = ["%YAML:1.0", "---", f"frameCount: {VIEWS}"]
    for k in range(VIEWS):
        for name, each in (("hand_in_base", hand[k]), ("board_in_cam", seen[k])):
            numbers = ", ".join(f"{v:.12e}" for v in each.ravel())
            lines += [f"{name}_{k}: !!opencv-matrix", "   rows: 4", "   cols: 4", "   dt: d"]
            lines += [f"   data: [ {numbers} ]"]
    return _written(folder / "TransformPairsInput.yml", "\n".join(lines))


def moveit(folder: Path, seen: np.ndarray, hand: np.ndarray) -> Path:
    samples = [
        {"effector_wrt_world": h.ravel().tolist(), "object_wrt_sensor": s.ravel().tolist()}
        for h, s in zip(hand, seen, strict=True)
    ]
    return _written(folder / "samples.yaml", yaml.safe_dump(samples))


def easy_handeye(folder: Path, seen: np.ndarray, hand: np.ndarray) -> Path:
    samples = [{"robot": _transform(h), "tracking": _transform(s)} for h, s in zip(hand, seen, strict=True)]
    return _written(folder / "eih_cam1.samples", yaml.safe_dump({"samples": samples}))


def objects_by_name(folder: Path, seen: np.ndarray, hand: np.ndarray) -> Path:
    content = {
        f"pose_{k}": {"gripper2base": hand[k].tolist(), "target2cam": seen[k].tolist()} for k in range(VIEWS)
    }
    return _written(folder / "poses.json", json.dumps(content))


def rows_in_turn(folder: Path, seen: np.ndarray, hand: np.ndarray) -> Path:
    lines = []
    for k in range(VIEWS):
        for name, each in (("hand", hand[k]), ("eye", seen[k])):
            angles = Rotation.from_matrix(each[:3, :3]).as_euler("xyz", degrees=True)
            lines.append(", ".join([name, *(f"{v:.9f}" for v in (*each[:3, 3], *angles))]))
    return _written(folder / "base_data.csv", "\n".join(lines) + "\n")


def frames_by_name(folder: Path, seen: np.ndarray, hand: np.ndarray) -> Path:
    """Each frame in rows of its own, with the frame's name in a column."""
    lines = ["stamp_s,child_frame_id,x,y,z,qx,qy,qz,qw"]
    for name, each, late in (("tool0", hand, 0.0), ("tag_3", seen, 0.01)):
        for k, pose in enumerate(each):
            numbers = (*pose[:3, 3], *Rotation.from_matrix(pose[:3, :3]).as_quat())
            lines.append(f"{4.0 * k + late:.3f},{name}," + ",".join(f"{v:.9f}" for v in numbers))
    return _written(folder / "tf.csv", "\n".join(lines) + "\n")


MAKERS = [opencv, moveit, easy_handeye, objects_by_name, rows_in_turn, frames_by_name]


@pytest.mark.parametrize("write", MAKERS, ids=lambda each: each.__name__)
def test_a_draft_reads_the_poses_and_closes_the_chain(
    tmp_path: Path, write: Callable[[Path, np.ndarray, np.ndarray], Path]
) -> None:
    seen, hand = poses()
    out = tmp_path / "draft.yaml"
    assert run(["bag", "draft", str(write(tmp_path, seen, hand)), "--out", str(out)]) == 0
    content = yaml.safe_load(out.read_text())
    asked = content.pop("questions", [])
    assert not [each for each in asked if "other way round" not in each and "eye in hand" not in each]
    assert "camera_arm" in content["poses"] and content["poses"]["at_rest"] is True
    out.write_text(yaml.safe_dump(content))
    (made,) = import_any(out, tmp_path, None).made
    np.testing.assert_allclose(made.recording.seen.position, seen[:, :3, 3], atol=1e-6)
    arm = made.recording.camera_arm
    assert arm is not None and arm.flange is not None
    np.testing.assert_allclose(arm.flange.position, hand[:, :3, 3], atol=1e-6)
    turned = Rotation.from_quat(arm.flange.quat_xyzw).as_matrix()
    np.testing.assert_allclose(turned, hand[:, :3, :3], atol=1e-6)


def test_phases_of_one_motion_are_not_taken_for_two_things(tmp_path: Path) -> None:
    lines = ["t,phase,x,y,z,qx,qy,qz,qw"]
    lines += [f"{0.01 * k},{'air' if k < 20 else 'ground'},{0.01 * k},0,{k * k},0,0,0,1" for k in range(40)]
    path = _written(tmp_path / "toss.csv", "\n".join(lines))
    (table,) = read_logged_tables([path])
    assert not table.part and len(table.table.numbers("x", "it")) == 40


def test_numbered_joints_stay_columns_of_their_own(tmp_path: Path) -> None:
    path = _written(tmp_path / "a.json", json.dumps({f"q_{j}": list(range(50)) for j in range(4)}))
    assert set(read_table(path, CsvOptions(), "it").columns) == {"q_0", "q_1", "q_2", "q_3"}


def test_a_tensor_of_a_toss_is_read_without_running_code(tmp_path: Path) -> None:
    toss = torch.arange(2 * 19, dtype=torch.float32).reshape(1, 2, 19)
    torch.save(toss, tmp_path / "0.pt")
    np.testing.assert_array_equal(
        read_table(tmp_path / "0.pt", CsvOptions(), "it").numbers("data", "it"), toss[0].numpy()
    )
    torch.save({"run": {"q": torch.zeros(5, 3)}, "rate": 148}, tmp_path / "1.pt")
    assert list(read_table(tmp_path / "1.pt", CsvOptions(), "it").columns) == ["run.q"]

    ran = tmp_path / "ran"

    class Trap:
        def __reduce__(self) -> tuple[object, tuple[str, ...]]:
            return (Path.touch, (str(ran),))

    torch.save({"x": Trap()}, tmp_path / "2.pt")
    (tmp_path / "3.pt").write_bytes((tmp_path / "0.pt").read_bytes()[:300])
    for name in ("2.pt", "3.pt"):
        with pytest.raises(InputError, match="damaged, or holds more than tensors"):
            read_table(tmp_path / name, CsvOptions(), "it")
    assert not ran.exists()

    itself: list[object] = []
    itself.append(itself)
    torch.save({"x": itself}, tmp_path / "4.pt")
    with pytest.raises(InputError, match="cannot be read"):
        read_table(tmp_path / "4.pt", CsvOptions(), "it")


def test_a_label_that_is_not_there_is_named(tmp_path: Path) -> None:
    path = _written(tmp_path / "a.csv", "who,x\nhand,1\neye,2\nhand,3\n")
    options = CsvOptions(label="who")
    np.testing.assert_array_equal(read_table(path, options, "it", "hand").numbers("x", "it"), [1.0, 3.0])
    with pytest.raises(InputError, match="no rows of 'foot'; `part` names one of 'hand', 'eye'"):
        read_table(path, options, "it", "foot")
    with pytest.raises(InputError, match="no column 'what'"):
        read_table(path, CsvOptions(label="what"), "it", "hand")


def _transform(pose: np.ndarray) -> dict[str, dict[str, float]]:
    turned = dict(zip("xyzw", map(float, Rotation.from_matrix(pose[:3, :3]).as_quat()), strict=True))
    return {"translation": dict(zip("xyz", map(float, pose[:3, 3]), strict=True)), "rotation": turned}


def _written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_a_target_of_another_size_is_asked_for(tmp_path: Path) -> None:
    """As MoveIt's users save them: the tag's size was typed in wrongly, and no transform makes up for it."""
    (seen, hand), factor = poses(), 0.31
    noise = np.random.default_rng(7).normal(0.0, 0.001, (VIEWS, 3))
    seen[:, :3, 3] = (seen[:, :3, 3] + noise) / factor
    draft = draft_any([moveit(tmp_path, seen, hand)], None, None)
    assert "camera_arm" in draft.poses
    (question,) = draft.questions
    told = re.search(r"([\d.]+) times that size closes the chain to ([\d.]+) mm", question)
    assert told and float(told[1]) == pytest.approx(factor, rel=0.03) and float(told[2]) < 5.0
    mapping = tmp_path / "mapping.yaml"
    mapping.write_text(yaml.safe_dump({k: v for k, v in draft.as_mapping().items() if k != "questions"}))
    (imported,) = import_any(mapping, tmp_path, None).made  # as one that was written by hand
    assert "the chain stays open by" in imported.notes[-1] and "0.31 times the size" in imported.notes[-1]


def test_a_target_of_its_size_is_not_asked_for(tmp_path: Path) -> None:
    seen, hand = poses()
    seen[:, :3, 3] += np.random.default_rng(7).normal(0.0, 0.008, (VIEWS, 3))
    draft = draft_any([moveit(tmp_path, seen, hand)], None, None)
    assert not any("size" in question for question in draft.questions)


def test_views_that_do_not_turn_are_asked_for(tmp_path: Path) -> None:
    """Of 22 views that a JAKA's owner saved none turns: the camera came out 17 m from its flange."""
    _, hand = poses()
    still = np.tile(hand[0], (VIEWS, 1, 1))
    still[:, :3, 3] = hand[:, :3, 3]
    eye, board = np.eye(4), np.eye(4)
    eye[:3, 3], board[:3, 3] = [0.05, 0.02, 0.07], [0.5, 0.1, 0.0]
    draft = draft_any([moveit(tmp_path, np.linalg.inv(still @ eye) @ board, still)], None, None)
    assert any("turns about two axes" in question for question in draft.questions)
