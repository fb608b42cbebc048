"""Depth images of a wall without a mapping: what is sure, what is asked, what is found, what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image

from samrl_core.common.errors import InputError
from samrl_ros.cli.main import run
from samrl_ros.log_import.devices import read_devices
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.writing import as_yaml
from samrl_ros.log_import.formats.depth_images import distance_in, images_in, is_depth_file
from samrl_ros.log_import.formats.intrinsics import Intrinsics, read_cameras
from samrl_ros.log_import.reading_importer import nearest_surfaces, readings_of
from tests.recordings.logs.depth_cameras import (
    CX,
    CY,
    FX,
    FY,
    MATRIX,
    make_board,
    make_realsense,
    make_ros_dump,
    make_stack,
    make_tum,
    save,
    wall,
)


def report(path: Path, folder: Path) -> dict:
    assert run(["diagnose", str(path), "--out", str(folder)]) == 0
    return json.loads((folder / "report.json").read_text())


def check(found: dict, name: str, truth: float) -> None:
    (effect,) = found["effects"]
    assert found["verdict"] == "effect" and effect["family"] == "depth_scale"
    (value,) = [effect["parameters"][name]]
    assert set(effect["parameters"]) == {name}
    low, high = value["ci95"]
    assert low <= truth <= high and high - low < 0.2 * abs(truth)


@pytest.mark.parametrize("floor", [False, True])
def test_folders_by_distance_show_a_factor(tmp_path: Path, floor: bool) -> None:
    check(report(make_realsense(tmp_path / "wall", 0.012, floor), tmp_path / "report"), "a", 0.012)


def test_a_camera_that_is_right_has_no_gap(tmp_path: Path) -> None:
    assert report(make_realsense(tmp_path / "wall", 0.0), tmp_path / "report")["verdict"] == "no_gap"


def test_a_stack_of_arrays_shows_a_factor(tmp_path: Path) -> None:
    check(report(make_stack(tmp_path / "stack", -0.02), tmp_path / "report"), "a", -0.02)


def test_a_folder_of_stacks_that_hold_their_distances(tmp_path: Path) -> None:
    """Each its own: one list for all would be another's."""
    folder, rng = tmp_path / "rail", np.random.default_rng(3)
    folder.mkdir()
    for name, at in (("down", [0.9, 0.8, 0.7]), ("up", [0.7, 0.8, 0.9])):
        raw = np.stack([np.round(1000 * wall(rng, d)).astype(np.uint16) for d in at])
        np.savez(folder / f"{name}.npz", depth=raw, distance_mm=1e3 * np.array(at), K=np.array(MATRIX))
    draft = draft_any([folder], None, None)
    assert not draft.questions
    found = read_devices([folder], [])
    assert found is not None and found.kind == "readings"
    for each in (*found.fit, *found.held_out):
        np.testing.assert_allclose(each.reading, each.reference, atol=0.01)


@pytest.mark.parametrize("make", [pytest.param(make_stack, marks=pytest.mark.thorough), make_realsense])
def test_a_draft_says_how_to_go_on(make, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Files count from the stack's folder, and from the one above a folder of images."""
    log, mapping = make(tmp_path / "log", 0.01), tmp_path / "elsewhere" / "mapping.yaml"
    mapping.parent.mkdir()
    assert run(["bag", "draft", str(log), "--out", str(mapping)]) == 0
    words = capsys.readouterr().out.splitlines()[-1].split()
    assert words[:3] == ["then:", "samrl", "diagnose"]
    (source,) = yaml.safe_load(mapping.read_text())["sources"].values()
    assert (Path(words[words.index("--data") + 1]) / source["file"]).exists()


def test_a_path_that_is_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no file or folder .*wall"):
        list(images_in(tmp_path / "wall", "here"))


def test_an_offset_may_be_where_the_camera_sits(tmp_path: Path) -> None:
    found = report(make_ros_dump(tmp_path / "dump", 0.006), tmp_path / "report")
    assert found["verdict"] == "ambiguous"
    families = {each["family"] for each in (*found["effects"], *found["runner_ups"])}
    assert families == {"hand_eye", "depth_scale"}


def test_poses_of_a_board_give_the_plane_of_a_leaning_wall(tmp_path: Path) -> None:
    folder = make_tum(tmp_path / "tum", 0.008)
    draft = draft_any([folder], None, None)
    (question,) = draft.questions
    assert "depth aligned" in question
    assert draft.sources["log"]["images"]["per_metre"] == 5000.0
    mapping = tmp_path / "mapping.yaml"
    assert run(["bag", "draft", str(folder), "--out", str(mapping)]) == 0
    lines = mapping.read_text().splitlines()
    begin = lines.index("questions:")
    mapping.write_text("\n".join([*lines[:begin], *lines[begin + 2 :]]))
    assert run(["bag", "import", str(mapping), "--out", str(tmp_path / "bags")]) == 0
    check(report(tmp_path / "bags", tmp_path / "report"), "c", 0.008)


def test_a_board_before_a_larger_wall_reads_the_board(tmp_path: Path) -> None:
    """The plane of most depth was the wall's, up to twice as far away, and the board read nothing."""
    factor = 0.012
    draft = draft_any([make_board(tmp_path / "board", factor)], None, None)
    draft.guesses.clear()  # what is asked is so
    (found,) = readings_of(as_yaml(draft), tmp_path / "mapping.yaml", tmp_path)
    off = found.recording.reading / found.recording.reference - 1.0
    assert len(off) > 50 and np.median(off) == pytest.approx(factor, abs=3e-4)
    assert np.abs(off - factor).max() < 4e-3  # 0.12 % of noise; a part that is half filled read 1 %
    assert any("in 6 of 6 images a larger surface" in note for note in found.notes)


def test_poses_that_no_surface_is_at_are_refused() -> None:
    """As of a colour camera elsewhere, or in another unit; one image of many is left out and told."""
    image, surface = np.repeat(np.arange(4.0), 6), np.tile([0.0, 0.0, 0.0, 1.0, 1.0, 1.0], 4)
    read, reference = np.where(surface > 0, 0.6, 2.0), np.full(24, 0.61)
    reference[:6] = 1.1
    notes: list[str] = []
    keep = nearest_surfaces(image, surface, read, reference, "here", notes)
    assert np.array_equal(keep, (image > 0) & (surface > 0))
    assert "1 of 4 images show no surface" in notes[0] and "in 3 of 4 images a larger surface" in notes[1]
    with pytest.raises(InputError, match="in 4 of 4 images no surface is within 25% of the reference"):
        nearest_surfaces(image, surface, read, 1e-3 * reference, "here", notes)


def test_what_no_file_says_is_asked_for(tmp_path: Path) -> None:
    for k in range(3):
        save(tmp_path / "wall" / f"{k}.png", wall(np.random.default_rng(k), 1.0))
    with pytest.raises(InputError) as caught:
        read_devices([tmp_path / "wall"], [])
    for asked in ("how far was it", "do 1000 make a metre", "what are fx, fy, cx and cy"):
        assert asked in str(caught.value)


def test_raw_numbers_that_fit_no_unit_are_asked_for(tmp_path: Path) -> None:
    for k, distance in enumerate((0.5, 1.0)):
        save(tmp_path / "wall" / f"{distance}m.png", wall(np.random.default_rng(k), distance), 1300.0)
    draft = draft_any([tmp_path / "wall"], None, None)
    assert any("how many should" in question for question in draft.questions)


@pytest.mark.parametrize(
    "spoil, message",
    [
        (lambda f: Image.new("L", (9, 9), 7).save(f / "a_0.3m.png"), "a picture of 8 bits"),
        (lambda f: save(f / "a_0.3m.png", np.ones((9, 9))), "put images of one camera and one size"),
        (lambda f: (f / "a_0.3m.png").write_bytes(b"\x89PNG"), "cannot be read as an image"),
        (lambda f: (f / "a_0.3m.pgm").write_bytes(b"P5\n100000 100000\n65535\n"), "OpenCV refuses"),
    ],
)  # fmt: skip
def test_images_that_are_no_depth_are_refused(tmp_path: Path, spoil, message: str) -> None:
    save(tmp_path / "wall" / "b_0.5m.png", wall(np.random.default_rng(0), 0.5))
    spoil(tmp_path / "wall")
    with pytest.raises(InputError, match=message):
        read_devices([tmp_path / "wall"], [])
    assert run(["diagnose", str(tmp_path / "wall"), "--out", str(tmp_path / "report")]) == 3


def test_an_array_that_is_called_an_archive_is_read_as_one(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    np.save((tmp_path / "run.npz").open("wb"), np.stack([wall(rng, 0.5), wall(rng, 1.0)]))
    (tmp_path / "tape.csv").write_text("tape_cm\n50\n100\n")
    draft = draft_any([tmp_path / "run.npz"], None, None)
    assert draft.sources["log"]["images"]["per_metre"] == 1.0
    np.savez((tmp_path / "empty.npy").open("wb"))  # and an archive that is called an array
    assert not is_depth_file(tmp_path / "empty.npy")


def test_nothing_but_zeros_is_refused(tmp_path: Path) -> None:
    save(tmp_path / "wall" / "0.5m.png", np.zeros((240, 320)))
    with pytest.raises(InputError, match="no image holds depth in its middle"):
        read_devices([tmp_path / "wall"], [])


def test_a_heap_of_things_is_no_plane(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    for distance in (0.5, 1.0):
        save(tmp_path / "heap" / f"{distance}m.png", distance * rng.uniform(0.6, 1.5, (240, 320)))
    (tmp_path / "heap" / "K.txt").write_text("\n".join(" ".join(map(str, row)) for row in MATRIX))
    with pytest.raises(InputError, match="no image of heap shows a plane"):
        read_devices([tmp_path / "heap"], [])


@pytest.mark.parametrize(
    "name, text",
    [
        ("camera_info.yaml", f"K: [{FX}, 0, {CX}, 0, {FY}, {CY}, 0, 0, 1]"),
        ("open3d.json", json.dumps({"intrinsic_matrix": np.transpose(MATRIX).ravel().tolist()})),
        ("intrinsic_depth.txt", f"{FX} 0 {CX} 0\n0 {FY} {CY} 0\n0 0 1 0\n0 0 0 1\n"),
        ("calib.txt", f"{FX} {FY} {CX} {CY}\n"),
        ("opencv.yml", "%YAML:1.0\n---\nM:\n  camera_matrix: !!opencv-matrix\n    rows: 3\n    cols: 3\n"
                       f"    dt: d\n    data: [{FX}, 0., {CX}, 0., {FY}, {CY}, 0., 0., 1.]\n"),
    ],
)  # fmt: skip
def test_intrinsics_are_read_as_tools_write_them(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text)
    (tmp_path / "notes.txt").write_text("wall of the lab, 3 May")
    (camera,) = read_cameras([tmp_path])
    assert camera.intrinsics == Intrinsics(FX, FY, CX, CY)


def test_distances_in_names() -> None:
    names = (
        "0.8m/3.png",
        "wall_500mm_03.png",
        "d 80 cm.png",
        "1m/depth_2.png",
        "run3/0001.png",
        "a_0,5m.png",
    )
    assert [distance_in(name) for name in names] == [0.8, 0.5, 0.8, 1.0, None, 0.5]
