"""Forms in which people publish recordings: halves of a chain, lists of OpenCV, trials side by side."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from samrl_core.common.errors import InputError
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.bodies.unclear_height import refuse_unclear_height
from samrl_ros.log_import.draft.tracks.logged_tracks import read_logged_tables
from samrl_ros.log_import.draft.writing import as_yaml
from samrl_ros.log_import.importer import import_recording
from samrl_ros.log_import.mapping import parse_mapping
from samrl_ros.log_import.reading_importer import readings_of

VIEWS = 9
RNG = np.random.default_rng(5)


def transforms(spread: float) -> np.ndarray:
    """Random poses (VIEWS, 4, 4) around the origin [m]."""
    out = np.tile(np.eye(4), (VIEWS, 1, 1))
    out[:, :3, :3] = Rotation.from_rotvec(RNG.normal(0.0, 0.6, (VIEWS, 3))).as_matrix()
    out[:, :3, 3] = RNG.normal(0.0, spread, (VIEWS, 3))
    return out


def test_lists_of_opencv_are_poses_by_their_spelt_names(tmp_path: Path) -> None:
    hand = transforms(0.3)
    camera = transforms(0.05)[0]
    board = transforms(0.3)[0]
    seen = np.linalg.inv(hand @ camera) @ board
    lines = ["%YAML:1.0", "---"]
    for name, rows in (
        ("Rotation_Vec", Rotation.from_matrix(seen[:, :3, :3]).as_rotvec()),
        ("Translation_Vec", 1000.0 * seen[:, :3, 3]),
    ):
        lines += [f"{name}:"]
        for row in rows:
            lines += ["   - !!opencv-matrix", "      rows: 3", "      cols: 1", "      dt: d"]
            lines += [f"      data: {row.tolist()}"]
    (tmp_path / "board_pose.yml").write_text("\n".join(lines))
    poses = np.hstack([1000.0 * hand[:, :3, 3], Rotation.from_matrix(hand[:, :3, :3]).as_rotvec()])
    numbered = [f"pose{k + 1}: {pose.tolist()}" for k, pose in enumerate(poses)]
    (tmp_path / "robot_poses.yaml").write_text(
        "\n".join(["%YAML:1.0", "---", "angle_unit: radian", *numbered])
    )
    draft = draft_any(sorted(tmp_path.iterdir()), None, None)
    assert draft.poses["target_in_camera"]["rotation_vector"] == "Rotation_Vec"
    assert draft.poses["target_in_camera"]["unit"] == "mm" and "camera_arm" in draft.poses
    assert draft.closes_m < 1e-6


@pytest.mark.parametrize(
    "name, head, extra",
    [
        ("robot_poses.csv", "file,x,y,z,rx(deg),ry(deg),rz(deg)", 0),
        ("views.csv", "image,x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg,j1_deg,j2_deg,j3_deg,j4_deg", 4),
    ],
)
def test_an_arms_poses_alone_are_half_of_a_chain_and_no_body(
    tmp_path: Path, name: str, head: str, extra: int
) -> None:
    rows = 90.0 * RNG.normal(size=(VIEWS, 6 + extra))
    text = [f"view_{k}.png," + ",".join(f"{x:.3f}" for x in row) for k, row in enumerate(rows)]
    (tmp_path / name).write_text("\n".join([head, *text]))
    with pytest.raises(InputError, match="none of a target that a camera saw.*rvec_x"):
        draft_any([tmp_path / name], None, None)


def test_a_body_called_by_its_file_is_no_arm(tmp_path: Path) -> None:
    rows = np.column_stack([np.linspace(0.0, 0.4, 60), np.full(60, 0.1), np.zeros(60), np.zeros((60, 3))])
    path = tmp_path / "cube_robot.csv"
    np.savetxt(path, rows, delimiter=",", header="x,y,z,rx,ry,rz", comments="")
    assert draft_any([path], None, None).bodies


@pytest.mark.parametrize(
    "head, unit, up",
    [
        ("Time (s),Position (m),Velocity (m/s)", "m", -1),  # from where it was let go, downwards
        ("Tiempo (s),Posición (m)", "m", -1),
        ("time,height", "m", 1),
        ("tiempo,altura_cm", "cm", 1),
    ],
)
def test_what_falls_along_one_axis_is_a_body_and_no_joint(
    tmp_path: Path, head: str, unit: str, up: int
) -> None:
    time = 0.01 * np.arange(60)
    fallen = 0.3 * time + 0.5 * 9.81 * time**2 + RNG.normal(0.0, 5e-4, len(time))
    height = (2.0 * (up > 0) - up * fallen) * {"m": 1.0, "cm": 100.0}[unit]
    rows = np.column_stack([time, height, 0.3 + 9.81 * time])[:, : head.count(",") + 1]
    np.savetxt(tmp_path / "drop.csv", rows, delimiter=",", header=head, comments="", encoding="utf-8")
    draft = draft_any([tmp_path / "drop.csv"], None, None)
    assert not draft.questions and draft.bodies["track"]["unit"] == unit
    assert draft.bodies["track"]["axes"] == "z" and draft.bodies["gravity"] == [0.0, 0.0, -9.81 * up]


@pytest.mark.parametrize(
    "head", ["time (s),x position (m),y position (m)", "t [s],X Coordinate [m],Y Coordinate [m]"]
)
def test_letters_before_the_word_for_a_place_are_axes_of_one_body(tmp_path: Path, head: str) -> None:
    """A puck seen from above was drafted as a joint in radians, a tossed ball was refused as too short."""
    t = np.arange(60) / 60.0
    for name, across in (("puck", 0.7 * t - 0.3 * t**2), ("ball", 5.0 * t - 0.5 * 9.81 * t**2)):
        rows = [f"{a:.4f},{0.2 + 0.4 * a:.5f},{b:.5f}" for a, b in zip(t, across, strict=True)]
        (tmp_path / f"{name}.csv").write_text("\n".join([head, *rows]))
    slides = draft_any([tmp_path / "puck.csv"], None, None)
    assert slides.bodies["track"]["axes"] == "xy" and slides.bodies["track"]["unit"] == "m"
    assert [q for q in slides.questions if "level plane" in q] == slides.questions
    flies = draft_any([tmp_path / "ball.csv"], None, None)
    assert flies.bodies["gravity"] == [0.0, pytest.approx(-9.81, abs=0.01), 0.0] and not flies.questions


@pytest.mark.parametrize("rate_hz, seconds, rows", [(3.0, 9.0, 27), (10.0, 6.0, 60)])
def test_a_height_that_scatters_by_metres_is_refused_with_what_to_record(
    tmp_path: Path, rate_hz: float, seconds: float, rows: int
) -> None:
    """A fall by GPS was refused as too short for a joint, a longer one was drafted as a joint."""
    t = np.arange(rows) / rate_hz
    height = 400.0 - 4.905 * np.maximum(t - seconds + 7.0, 0.0) ** 2 + RNG.normal(0.0, 8.0, rows)
    lines = [f"{a:.3f},{b:.3f}" for a, b in zip(t, height, strict=True)]
    (tmp_path / "caida.csv").write_text("\n".join(["tiempo,altura", *lines]))
    with pytest.raises(InputError, match=rf"{rows} samples, {rate_hz:.3g} a second, scatters by .*Film it"):
        draft_any([tmp_path / "caida.csv"], None, None)


def test_a_lift_that_moves_smoothly_is_no_unclear_fall(tmp_path: Path) -> None:
    lines = [f"{0.02 * k:.3f},{0.5 + 0.2 * np.sin(0.02 * k):.5f}" for k in range(60)]
    (tmp_path / "lift.csv").write_text("\n".join(["time,height_m", *lines]))
    (table,) = read_logged_tables([tmp_path / "lift.csv"])
    assert len(table.tracks()) == 1
    refuse_unclear_height(table.tracks())


def test_letters_of_a_gantry_stay_joints(tmp_path: Path) -> None:
    wave = np.sin(np.arange(80) / 9.0)
    rows = [f"{k / 60:.4f},{a:.5f},{b:.5f}" for k, (a, b) in enumerate(zip(wave, wave**2, strict=True))]
    (tmp_path / "run.csv").write_text("\n".join(["time,x_pos,y_pos", *rows]))
    assert draft_any([tmp_path / "run.csv"], None, None).joints == ["x", "y"]


def test_a_position_that_does_not_fall_stays_a_joints(tmp_path: Path) -> None:
    time = 0.01 * np.arange(60)
    rows = np.column_stack([time, 0.2 * np.sin(3.0 * time)])
    np.savetxt(tmp_path / "slide.csv", rows, delimiter=",", header="Time (s),Position (m)", comments="")
    assert not draft_any([tmp_path / "slide.csv"], None, None).bodies


def test_decimal_commas_in_quotes_are_numbers_and_misplaced_names_are_asked_for(tmp_path: Path) -> None:
    time = np.arange(27) / 30.0
    rows = np.column_stack([time, 3.6 * time, 4.2 * time - 0.5 * 9.81 * time**2])
    text = [",".join(f'"{x:.2E}"'.replace(".", ",") for x in row) for row in rows]
    (tmp_path / "throw.csv").write_text("\n".join(["X, Y, t", *text]))  # they are time, x and height
    draft = draft_any([tmp_path / "throw.csv"], None, None)
    assert draft.sources["track"]["csv"]["decimal"] == ","
    assert any("order of the columns" in question for question in draft.questions)
    table = read_logged_tables([tmp_path / "throw.csv"])[0].table
    np.testing.assert_allclose(table.numbers("Y", "here"), rows[:, 1], atol=0.02)
    (tmp_path / "right.csv").write_text("\n".join(["t, X, Y", *text]))
    right = draft_any([tmp_path / "right.csv"], None, None)
    assert not right.questions and right.bodies["gravity"] == [0.0, -9.81, 0.0]


@pytest.mark.parametrize(
    "head, unit",
    [
        ("actual_distance_m,{}", "m"),
        ("Distance (cm),{},Average", "cm"),
    ],
)
def test_trials_side_by_side_are_readings_of_their_rows_distance(
    tmp_path: Path, head: str, unit: str
) -> None:
    true = np.array([0.3, 0.5, 0.7, 0.9]) * {"m": 1.0, "cm": 100.0}[unit]
    read = 1.03 * true[:, None] * (1.0 + 0.002 * RNG.normal(size=(4, 12)))
    names = ",".join(f"sample_{k + 1}" if unit == "m" else f"Trial {k + 1}" for k in range(12))
    rows = np.column_stack([true, read, read.mean(axis=1)])[:, : 14 if "Average" in head else 13]
    path = tmp_path / "wall.csv"
    np.savetxt(path, rows, delimiter=",", header=head.format(names), comments="", fmt="%.5f")
    draft = draft_any([path], None, None)
    assert len(draft.questions) == 1 and "a sensor's distances" in draft.questions[0]
    draft.guesses.clear()  # answered
    (made,) = readings_of(as_yaml(draft), tmp_path / "mapping.yaml", tmp_path)
    metres = {"m": 1.0, "cm": 0.01}[unit]
    np.testing.assert_allclose(made.recording.reading, metres * read.ravel(), atol=2e-5)
    np.testing.assert_allclose(made.recording.reference, metres * np.repeat(true, 12))
    assert (np.diff(made.recording.time) > 0).all()


def test_an_empty_trial_leaves_the_others_of_its_row(tmp_path: Path) -> None:
    """The row was left out whole: of three distances one, and twelve readings, for one cell."""
    true = np.array([0.3, 0.5, 0.7])
    read = 1.03 * true[:, None] * (1.0 + 0.002 * RNG.normal(size=(3, 12)))
    rows = [",".join([f"{d}", *(f"{v:.5f}" for v in each)]) for d, each in zip(true, read, strict=True)]
    rows[1] = rows[1].replace(f"{read[1, 4]:.5f}", "")
    path = tmp_path / "tof.csv"
    path.write_text("\n".join([",".join(["distance_m", *(f"trial_{k}" for k in range(12))]), *rows]))
    draft = draft_any([path], None, None)
    draft.guesses.clear()  # answered
    (made,) = readings_of(as_yaml(draft), tmp_path / "mapping.yaml", tmp_path)
    np.testing.assert_allclose(made.recording.reading, np.delete(read.ravel(), 16), atol=1e-5)
    np.testing.assert_allclose(made.recording.reference, np.delete(np.repeat(true, 12), 16))
    assert any("1 missing cells, drop_cell" in note for note in made.notes)


def test_empty_cells_are_left_out_of_trials_alone(tmp_path: Path) -> None:
    path = tmp_path / "arm.csv"
    path.write_text("t,q\n" + "".join(f"{0.01 * k},{'' if k == 7 else 0.1 * k}\n" for k in range(60)))
    text = (
        "joints: [a]\n"
        "sources: {log: {file: arm.csv, time: {column: t}, columns: {q: q}, missing: drop_cell}}\n"
        "channels: {states: {source: log, position: {formula: q, unit: rad}}}\nrecordings: [{name: a}]\n"
    )
    mapping = parse_mapping(text, tmp_path / "mapping.yaml")
    with pytest.raises(InputError, match="drop_cell.*trials of a depth.*drop_row"):
        import_recording(mapping.recordings[0], mapping, tmp_path)


def test_means_of_a_few_distances_are_refused_with_what_to_give(tmp_path: Path) -> None:
    path = tmp_path / "means.csv"
    path.write_text("actual_distance_m,count,measured_mean_m\n0.1,30,0.11\n0.2,30,0.21\n0.3,30,0.32\n")
    with pytest.raises(InputError, match="every reading, and not their mean.*trial_1"):
        draft_any([path], None, None)


def test_the_same_points_in_two_frames_are_no_motions_of_a_body(tmp_path: Path) -> None:
    grid = np.stack(np.meshgrid([0.2, 0.3], [0.0, 0.1], [0.1, 0.2, 0.3], indexing="ij"), axis=-1).reshape(
        -1, 3
    )
    turn = Rotation.from_rotvec([0.3, 1.9, -0.4]).as_matrix()
    np.savetxt(tmp_path / "measured_pts.txt", grid)
    np.savetxt(
        tmp_path / "observed_pts.txt", grid @ turn + [0.1, 0.0, 0.7] + RNG.normal(0.0, 1e-3, grid.shape)
    )
    files = sorted(tmp_path.iterdir())
    with pytest.raises(InputError, match="same 12 points in two frames.*solvePnP"):
        draft_any(files, None, None)
    np.savetxt(files[1], RNG.normal(size=grid.shape))
    draft_any(files, None, None)  # other numbers may be motions, and are asked about
