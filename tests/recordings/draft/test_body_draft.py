"""Drafted mappings of bodies' tracks in other people's formats: read as they were made, or a question."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
import torch
import yaml
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as BagWriter
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.body_recording import BodyRecording
from samrl_core.common.errors import InputError
from samrl_ros.cli.main import run
from samrl_ros.log_import.body_importer import bodies_of
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.bodies.free_fall import find_free_fall
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.writing import as_yaml
from samrl_ros.log_import.pose_specs import LENGTHS
from tests.diagnosis.bodies.body_worlds import Tracker, World, bounces, several, slide, toss
from tests.recordings.logs import body_logs
from tests.recordings.logs.body_logs import Y_UP, Writer

TURNED = World(gravity=(0.6, 0.0, -9.79))
# Writer, rotation of the log's frame against ours, and which poses were not lost.
FORMATS: list[tuple[Writer, Rotation]] = [
    (body_logs.motive, Y_UP),
    (body_logs.motive_labelled, Y_UP),
    (body_logs.vicon, Rotation.identity()),
    (body_logs.qualisys_markers, Rotation.identity()),
    (body_logs.qualisys_bodies, Rotation.identity()),
    (body_logs.tum, Rotation.identity()),
    (body_logs.euroc, Rotation.identity()),
    (body_logs.ros_echo, Rotation.identity()),
    (body_logs.ros_seconds, Rotation.identity()),
    (body_logs.semicolons, Rotation.identity()),
    (body_logs.arrays, Rotation.identity()),
]

LOSES_FOUR = (body_logs.motive, body_logs.qualisys_markers)


def drafted(*paths: Path) -> Draft:
    return draft_any(paths, None, None)


def imported(draft: Draft, folder: Path) -> list[BodyRecording]:
    """By the draft, with its questions answered as they stand."""
    content = {key: value for key, value in draft.as_mapping().items() if key != "questions"}
    return [each.recording for each in bodies_of(yaml.safe_dump(content), folder / "m.yaml", folder)]


def write_columns(path: Path, **columns: np.ndarray) -> Path:
    np.savetxt(path, np.stack(list(columns.values()), axis=1), delimiter=",", header=",".join(columns),
               comments="", fmt="%.6f")  # fmt: skip
    return path


@pytest.mark.parametrize(("write", "frame"), FORMATS, ids=[write.__name__ for write, _ in FORMATS])  # ty: ignore[missing-attribute]
def test_each_format_is_read_as_it_was_made(write: Writer, frame: Rotation, tmp_path: Path) -> None:
    (made,) = several(toss, TURNED, 1, 3)
    draft = drafted(write(tmp_path / "toss", made.track))
    assert draft.kind == "bodies" and not draft.questions, draft.questions
    (got,) = imported(draft, tmp_path)
    kept = np.array([np.abs(made.track.time - t).argmin() for t in got.track.time])
    assert len(got.track) == len(made.track) - (4 if write in LOSES_FOUR else 0)
    np.testing.assert_allclose(got.track.time, made.track.time[kept], atol=2e-4)
    np.testing.assert_allclose(got.track.position, frame.apply(made.track.position[kept]), atol=1e-5)
    np.testing.assert_allclose(got.gravity, frame.apply([0.0, 0.0, -9.81]), atol=1e-9)
    if got.track.turns:
        turned = Rotation.from_quat(got.track.quat_xyzw)
        apart = turned.inv() * frame * Rotation.from_quat(made.track.quat_xyzw[kept])
        assert float(apart.magnitude().max()) < 1e-4
    assert bool(got.track.turns) == (write not in (body_logs.semicolons, body_logs.qualisys_markers))


def test_a_folder_of_tosses_is_diagnosed_in_one_step(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "tosses"
    folder.mkdir()
    for made in several(toss, TURNED, 6, 3):
        body_logs.motive(folder / made.name, made.track)
    assert run(["diagnose", str(folder), "--out", str(tmp_path / "report")]) == 0
    report = json.loads((tmp_path / "report" / "report.json").read_text())
    assert [f"{e['family']}@{e['place']}" for e in report["effects"]] == ["base_tilt@cell"]
    assert "+y is up" in " ".join(report["notes"]), report["notes"]
    assert sorted(i["role"] for i in report["inputs"]) == ["fit"] * 4 + ["held_out"] * 2


def test_a_slide_asks_and_names_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing falls: neither the direction of gravity nor the unit is proven."""
    for made in several(slide, World(friction=0.9), 3, 1, speed=3.0):
        t = made.track
        write_columns(tmp_path / f"{made.name}.csv", t=t.time, x=t.position[:, 0], y=t.position[:, 1])
    assert run(["diagnose", str(tmp_path), "--out", str(tmp_path / "report")]) == 3
    error = capsys.readouterr().err
    assert "is it a level plane seen from above?" in error and "is the unit m" in error
    assert f"samrl bag draft {tmp_path} --out mapping.yaml" in error
    assert not (tmp_path / "report").exists()


def test_a_question_that_was_answered_leaves_a_mapping_that_runs(tmp_path: Path) -> None:
    for made in several(slide, World(friction=0.25), 4, 1):
        t = made.track
        ms, x, y = 1e3 * t.time, 1e3 * t.position[:, 0], 1e3 * t.position[:, 1]
        write_columns(tmp_path / f"{made.name}.csv", frame=np.arange(len(ms)), time_ms=ms, x_mm=x, y_mm=y)
    out = tmp_path / "m.yaml"
    assert run(["bag", "draft", str(tmp_path), "--out", str(out)]) == 0
    content = yaml.safe_load(out.read_text())
    assert len(content.pop("questions")) == 1  # whether the plane is level; units are in the names
    content["bodies"]["support"]["friction"] = 0.25
    out.write_text(yaml.safe_dump(content))
    assert run(["bag", "import", str(out), "--check"]) == 0
    assert run(["bag", "import", str(out), "--out", str(tmp_path / "bags")]) == 0


def test_a_unit_that_free_fall_contradicts_is_asked_for(tmp_path: Path) -> None:
    (made,) = several(toss, World(), 1, 3)
    p = made.track.position
    path = write_columns(tmp_path / "ball.csv", t=made.track.time, x_cm=p[:, 0], y_cm=p[:, 1], z_cm=p[:, 2])
    (question,) = drafted(path).questions
    assert "the log says cm, but what falls says m" in question


def test_zeros_of_lost_frames_are_left_out(tmp_path: Path) -> None:
    (made,) = several(toss, World(), 1, 3)
    p = 1e3 * made.track.position + [0.0, 0.0, 900.0]
    p[[10, 11, 12, 40, 41]] = 0.0
    path = write_columns(tmp_path / "cube.csv", t=made.track.time, x=p[:, 0], y=p[:, 1], z=p[:, 2])
    draft = drafted(path)
    assert not draft.questions and "5 poses are exactly zero" in as_yaml(draft)
    (got,) = imported(draft, tmp_path)
    assert len(got.track) == len(p) - 5
    assert float(np.abs(np.diff(got.track.position, axis=0)).max()) < 0.2


def test_a_body_that_rests_at_the_origin_is_there(tmp_path: Path) -> None:
    """Zeros that a motion ends in are a place."""
    time = np.arange(0.0, 2.0, 0.01)
    x = np.where(time < 1.0, 0.5 * (1.0 - time) ** 2, 0.0)
    draft = drafted(write_columns(tmp_path / "puck.csv", t=time, x_m=x, y_m=-x))
    assert "exactly zero" not in as_yaml(draft)


def test_a_wrong_frame_rate_is_asked_for(tmp_path: Path) -> None:
    (made,) = several(toss, World(tracker=Tracker(rate=30.0)), 1, 3)
    p = made.track.position
    path = write_columns(tmp_path / "ball.csv", t=made.track.time / 1.25, x=p[:, 0], y=p[:, 1], z=p[:, 2])
    (question,) = drafted(path).questions
    assert "frame rate and playback speed" in question


def test_pixels_are_asked_for_and_up_is_told(tmp_path: Path) -> None:
    """Image rows count downwards; a bouncing ball says so in whatever unit."""
    (made,) = several(bounces, World(), 1, 3)
    p = made.track.position
    path = write_columns(
        tmp_path / "ball.csv", frame=np.arange(len(p)), x=300 + 800 * p[:, 0], y=700 - 800 * p[:, 2]
    )
    draft = drafted(path)
    assert draft.bodies["gravity"] == [0.0, 9.81, 0.0] and draft.bodies["track"]["axes"] == "xy"
    asked = " ".join(draft.questions)
    assert len(draft.questions) == 2 and "frame rate" in asked and "pixel" in asked
    assert draft.sources["track"]["time"]["column"] == "frame"


def test_of_several_bodies_the_one_that_falls_is_taken(tmp_path: Path) -> None:
    (one, other) = several(toss, World(), 2, 3)
    columns = {"t": one.track.time}
    for name, p in (
        ("hand", 0.2 * np.sin(one.track.time)[:, None] + np.zeros(3)),
        ("ball", one.track.position),
    ):
        columns |= {f"{name}_{axis}": p[:, k] for k, axis in enumerate("xyz")}
    draft = drafted(write_columns(tmp_path / "a.csv", **columns))
    assert draft.bodies["track"]["position"] == ["ball_x", "ball_y", "ball_z"] and not draft.questions
    columns |= {f"cube_{axis}": other.track.position[:, k] for k, axis in enumerate("xyz")}
    (question,) = drafted(write_columns(tmp_path / "b.csv", **columns)).questions
    assert "and not" in question and "cube_x" in question


def test_what_touches_asks_for_its_shape(tmp_path: Path) -> None:
    """A ball that rolls is no point that slides, and no column says which it is."""
    (made,) = several(bounces, World(), 1, 3)
    p = np.vstack([made.track.position, made.track.position[-1] + np.outer(np.arange(60), [0.004, 0.0, 0.0])])
    time = np.arange(len(p)) / 120.0
    draft = drafted(write_columns(tmp_path / "ball.csv", t=time, x=p[:, 0], y=p[:, 1], z=p[:, 2]))
    (question,) = draft.questions
    assert "what is its shape?" in question
    assert "solved for and not judged" in " ".join(as_yaml(draft).replace("#", "").split())


def test_columns_without_names_are_asked_for(tmp_path: Path) -> None:
    (made,) = several(toss, World(), 1, 3)
    t = made.track
    rows = np.column_stack([1305031098 + t.time, t.position, t.quat_xyzw])
    np.savetxt(tmp_path / "poses.txt", rows, fmt="%.6f")
    draft = drafted(tmp_path / "poses.txt")
    assert len(draft.questions) == 2 and all("quaternion" in q or "order" in q for q in draft.questions)
    assert draft.sources["track"]["csv"] == {"delimiter": " ", "header": False}
    (got,) = imported(draft, tmp_path)
    np.testing.assert_allclose(got.track.position, t.position, atol=1e-5)


def test_logs_of_machines_are_none_of_bodies(tmp_path: Path) -> None:
    time = np.arange(0.0, 4.0, 0.01)
    x = 0.1 * np.sin(2.0 * time)
    for k, columns in enumerate(
        (
            {"t": time, "q1": x, "q2": x, "x": x, "y": 2 * x, "z": x},  # an arm's joints and its tool
            {"t": time, "x": x, "y": -x, "x_ref": x, "y_ref": -x},  # a gantry and its set points
            {"t": time, "x": x, "force": 9.0 * x},  # a slide with a motor
            {"t": time, "joint_x": x, "joint_y": 0.5 * x},  # a pair of joints with odd names
        )
    ):
        path = write_columns(tmp_path / f"{k}.csv", **columns)
        assert drafted(path).kind == "joints", columns.keys()


def test_an_array_of_joints_is_none_of_bodies(tmp_path: Path) -> None:
    time = np.arange(0.0, 4.0, 0.01)
    two = 0.1 * np.stack([np.sin(2.0 * time), np.cos(time)], axis=1)
    np.savez(tmp_path / "a.npz", t=time, q=two)
    assert drafted(tmp_path / "a.npz").kind == "joints"
    np.savez(tmp_path / "b.npz", t=time, puck_pos=two)
    assert drafted(tmp_path / "b.npz").kind == "bodies"


@pytest.mark.parametrize("scale", [1.0, 100.0, 1000.0])
def test_what_an_arm_does_is_no_free_fall(scale: float) -> None:
    """Slow curves have 9.81 m/s^2 in some unit; they last too long, go too far, or bend."""
    rng = np.random.default_rng(0)
    time = np.arange(0.0, 12.0, 0.01)
    for size, rate in ((0.1, 1.0), (0.2, 3.0), (0.05, 10.0), (0.3, 0.3)):
        path = size * np.stack([np.sin(rate * time), np.cos(rate * time), np.sin(1.3 * rate * time)], axis=1)
        position = scale * (path + 2e-4 * rng.standard_normal(path.shape))
        wide = float(np.linalg.norm(np.ptp(position, axis=0)))
        units = {unit: factor for unit, factor in LENGTHS.items() if factor * wide < 8.0}
        assert find_free_fall(time, position, {"s": 1.0}, units) is None, (size, rate)


@pytest.mark.parametrize("friction", [0.1, 0.3, 0.6, 1.0])
def test_a_slide_is_no_free_fall(friction: float) -> None:
    """It brakes as hard as gravity pulls, but never speeds up along its way."""
    for made in several(slide, World(friction=friction), 3, 5, speed=2.0):
        track = made.track
        assert find_free_fall(track.time, track.position, {"s": 1.0}, LENGTHS) is None


def test_things_beside_each_other_are_no_motions_of_one_body(tmp_path: Path) -> None:
    """A table of a tossed cube and a wand that is carried about, told apart by a column."""
    (made,) = several(toss, World(), 1, 3)
    t, x, q = made.track.time, made.track.position, made.track.quat_xyzw
    wand = np.column_stack([0.2 * t, np.ones_like(t), 0.5 + 0.05 * np.sin(3.0 * t)])
    rows = ["t,name,x,y,z,qx,qy,qz,qw"]
    for k, stamp in enumerate(t):
        for name, at, turned in (("wand", wand[k], (0.0, 0.0, 0.0, 1.0)), ("cube", x[k], q[k])):
            rows.append(f"{stamp:.5f},{name}," + ",".join(f"{v:.7f}" for v in (*at, *turned)))
    (tmp_path / "take.csv").write_text("\n".join(rows))
    draft = drafted(tmp_path / "take.csv")
    assert draft.kind == "bodies" and draft.sources["track"]["part"] == "cube"
    assert draft.recordings == [{"name": "take"}] and any("wand" in each for each in draft.unused)
    (got,) = imported(draft, tmp_path)
    np.testing.assert_allclose(got.track.position, x, atol=1e-6)


def test_an_array_of_all_that_was_recorded_holds_a_pose(tmp_path: Path) -> None:
    """Position, quaternion and rates in one tensor per toss, as ContactNets ships them."""
    for k, made in enumerate(several(toss, World(), 3, 3)):
        track = made.track
        values = np.hstack([track.position, track.quat_xyzw[:, [3, 0, 1, 2]], np.zeros((len(track), 12))])
        torch.save(torch.tensor(values)[None], tmp_path / f"{k}.pt")
    draft = drafted(tmp_path)
    assert draft.kind == "bodies" and draft.recordings == [{"glob": "*.pt"}]
    assert draft.bodies["track"]["position"] == ["data[0]", "data[1]", "data[2]"]
    assert [each for each in draft.questions if "frame rate" in each]
    assert [each for each in draft.questions if "wxyz" in each]


@pytest.mark.parametrize("behind", [6, 12])
def test_a_table_of_states_without_names_holds_a_pose(behind: int, tmp_path: Path) -> None:
    """The same as text: position, quaternion, velocities and, of some, what moved it; it was refused."""
    for k, made in enumerate(several(toss, World(), 3, 3)):
        track = made.track
        speed = np.gradient(track.position, track.time, axis=0)
        rest = np.zeros((len(track), behind - 3))
        values = np.hstack([track.position, track.quat_xyzw[:, [3, 0, 1, 2]], speed, rest])
        np.savetxt(tmp_path / f"toss{k}.csv", values, delimiter=",", fmt="%.7g")
    draft = drafted(tmp_path)
    assert draft.kind == "bodies" and draft.recordings == [{"glob": "*.csv"}]
    assert len(draft.bodies["track"]["position"]) == 3 and len(draft.bodies["track"]["quaternion"]) == 4
    assert [each for each in draft.questions if "frame rate" in each]
    assert [each for each in draft.questions if "wxyz" in each]


def test_a_bag_of_frames_alone_says_what_to_record(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    kind = store.types["tf2_msgs/msg/TFMessage"]
    with BagWriter(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        topic = bag.add_connection("/tf", kind.__msgtype__, typestore=store)
        for k in range(60):
            bag.write(topic, k * 10**7, store.serialize_cdr(kind(transforms=[]), kind.__msgtype__))
    with pytest.raises(InputError, match=r"Its trees of frames are empty"):
        drafted(tmp_path / "bag")


@pytest.mark.parametrize(
    ("frame", "names", "up"),
    [
        (Y_UP, ("pos_x", "pos_y", "pos_z"), (0.0, -9.81, 0.0)),
        (Rotation.from_euler("x", np.pi), ("ned_x", "ned_y", "ned_z"), (0.0, 0.0, 9.81)),
    ],
)
def test_the_axis_across_the_plane_of_a_slide_is_proposed_and_asked_for(
    frame: Rotation, names: tuple[str, str, str], up: tuple[float, float, float], tmp_path: Path
) -> None:
    """Unity's and Motive's y, aviation's minus z: a fall would prove it, a slide does not."""
    for made in several(slide, World(friction=0.3), 3, 1):
        p = frame.apply(made.track.position)
        columns = {name: p[:, k] for k, name in enumerate(names)}
        write_columns(tmp_path / f"{made.name}.csv", t=made.track.time, **columns)
    draft = drafted(tmp_path)
    assert draft.bodies["gravity"] == pytest.approx(up)
    assert draft.bodies["support"]["normal"] == pytest.approx([-g / 9.81 for g in up])
    assert any("up? Else write gravity" in q for q in draft.questions)


@pytest.mark.parametrize("suffix", [".h5", ".json"])
def test_a_body_that_is_pushed_is_read_and_asked_when_it_is_free(suffix: str, tmp_path: Path) -> None:
    """Arrays of time, x, y and angle, as MIT's pushing data have them."""
    time = 1.46e9 + np.arange(200) / 250.0
    s = time - time[0]
    body = np.stack([time, 0.3 + 0.05 * s, 0.01 * s, 0.3 * s], axis=1)
    arrays = {"tip_pose": body + [0, -0.05, 0, 0], "object_pose": body, "ft_wrench": 0.1 * body}
    path = tmp_path / f"push{suffix}"
    if suffix == ".json":
        path.write_text(json.dumps({name: values.tolist() for name, values in arrays.items()}))
    else:
        with h5py.File(path, "w") as file:
            for name, values in arrays.items():
                file[name] = values
    draft = drafted(path)
    assert draft.bodies["track"]["position"] == ["object_pose[1]", "object_pose[2]"]
    assert draft.bodies["track"]["angle"] == "object_pose[3]"
    assert any("ft_wrench" in g.reason and "when is it free?" in g.question for g in draft.of("recordings"))
    (got,) = imported(draft, tmp_path)
    np.testing.assert_allclose(got.track.position[:, :2], body[:, 1:3], atol=1e-9)
    np.testing.assert_allclose(got.track.time, s, atol=1e-6)


def test_a_push_is_no_fall(tmp_path: Path) -> None:
    """A tip hits a block that slides on, now this way, now that: one of them speeds up as what falls does."""
    time = np.arange(200) / 250.0
    for number, (angle, pull) in enumerate(((0.3, 6.0), (2.0, 3.0), (4.0, 4.0), (5.5, 3.5))):
        way = np.where(time < 0.3, 0.0, 0.5 * pull * np.clip(time - 0.3, 0, 0.3) ** 2)
        way += np.where(time > 0.6, pull * 0.3 * np.minimum(time - 0.6, 0.15), 0.0)
        body = np.stack([time, way * np.cos(angle), way * np.sin(angle), 0.1 * time], axis=1)
        with h5py.File(tmp_path / f"hit_{number}.h5", "w") as file:
            file["object_pose"], file["tip_pose"] = body, body - [0, 0.05, 0, 0]
    draft = drafted(tmp_path)
    assert "gravity" not in draft.bodies and not draft.falls
    assert any("level plane seen from above" in q for q in draft.questions)


@pytest.mark.parametrize("runs", [1, 4])
def test_what_speeds_up_in_a_level_plane_does_not_tell_which_way_is_up(runs: int, tmp_path: Path) -> None:
    """A hand pushes a puck on a table in Motive's frame, y up, and nothing beside it says so."""
    rng = np.random.default_rng(3)
    time = np.arange(200) / 120.0
    for number, (angle, pull) in enumerate(((1.5, 7.5), (2.9, 3.0), (4.3, 4.0), (5.5, 3.5))[:runs]):
        way = 0.5 * pull * np.clip(time - 0.3, 0, 0.3) ** 2 + pull * 0.3 * np.clip(time - 0.6, 0, 0.2)
        p = np.stack([way * np.cos(angle), 0.03 + 0 * time, way * np.sin(angle)], axis=1)
        p += 2e-4 * rng.standard_normal(p.shape)
        columns = {f"puck_{axis}_mm": 1e3 * p[:, k] for k, axis in enumerate("xyz")}
        write_columns(tmp_path / f"push{number}.csv", t=time, **columns)
    draft = drafted(tmp_path if runs > 1 else tmp_path / "push0.csv")
    asked = [g.question for g in draft.of("bodies.gravity")]
    assert asked and all(" up" in question for question in asked)
    if runs > 1:
        assert draft.bodies["gravity"] == pytest.approx([0.0, -9.81, 0.0])


def test_a_round_body_is_asked_whether_it_rolls(tmp_path: Path) -> None:
    for made in several(slide, World(friction=0.3), 3, 1):
        x, y = made.track.position[:, 0], made.track.position[:, 1]
        write_columns(tmp_path / f"{made.name}.csv", t=made.track.time, ball_x=x, ball_y=y)
    assert any("ball by its name: does it roll?" in q for q in drafted(tmp_path).questions)
