"""A cell's correction: files, poses, and images held against the simulated world's lens, which is not it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from samrl_core.cell.calibration.cell_correction import (
    NO_CORRECTION,
    CellCorrection,
    CorrectionCovariance,
    correction_of,
    find_beyond,
    find_lens_places,
    read_correction,
    twist_names,
    write_correction,
)
from samrl_core.cell.instance.cell_instance import InstanceName, draw_instance
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.types.observation import Frame
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.world.lens import Lens
from samrl_core.common.errors import InputError

CELL = cell_named()
LENS = Intrinsics(128, 128, 166.0, 166.0, 64.0, 64.0)
FOUND = Pose.from_rpy(np.array([0.01, -0.02, 0.03]), (0.1, 0.0, -0.2))


def smooth(k: Intrinsics) -> tuple[np.ndarray, np.ndarray]:
    """A colour image and a depth that change slowly over the rays of a pinhole: pixels may be mixed."""
    u, v = np.meshgrid(np.arange(k.width) + 0.5, np.arange(k.height) + 0.5)
    x, y = (u - k.cx) / k.fx, (v - k.cy) / k.fy
    color = 128 + 100 * np.stack([np.sin(25 * x), np.sin(25 * y), np.sin(15 * (x + y))], axis=-1)
    return np.round(color).astype(np.uint8), (0.4 + 0.2 * x - 0.1 * y).astype(np.float32)


def test_a_file_holds_what_was_written(tmp_path: Path) -> None:
    path = tmp_path / "apply" / "cell.json"
    path.parent.mkdir()
    numbers = {"depth_scale": 0.02, "k1": -0.1}
    write_correction(path, CellCorrection(FOUND, FOUND.inverse(), numbers, ("hand_eye@sensor:camera",)))
    read = read_correction(path)
    assert read.camera_in_flange is not None and read.tool_base_in_camera_base is not None
    np.testing.assert_allclose(read.camera_in_flange.matrix(), FOUND.matrix(), atol=1e-12)
    np.testing.assert_allclose(read.tool_base_in_camera_base.matrix(), FOUND.inverse().matrix(), atol=1e-12)
    assert read.numbers == numbers and read.effects == ("hand_eye@sensor:camera",) and not read.is_empty


def test_a_file_holds_how_well_its_numbers_are_known(tmp_path: Path) -> None:
    hand, depth = np.diag(np.arange(1.0, 7.0)), np.array([[4e-4, 1e-5], [1e-5, 9e-6]])
    numbers = ("depth_scale", "depth_offset")
    covariance = CorrectionCovariance.of_blocks([(twist_names("camera_in_flange"), hand), (numbers, depth)])
    written = CellCorrection(FOUND, numbers=dict.fromkeys(numbers, 0.01), covariance=covariance)
    write_correction(tmp_path / "cell.json", written)
    read = read_correction(tmp_path / "cell.json").covariance
    assert read.of == (*twist_names("camera_in_flange"), *numbers)
    np.testing.assert_array_equal(read.matrix[:6, :6], hand)
    np.testing.assert_array_equal(read.matrix[6:, 6:], depth)
    assert not read.matrix[:6, 6:].any()


def test_what_was_found_last_of_a_number_takes_the_place_of_the_rest() -> None:
    first = (("fx", "fy"), np.array([[2.0, 1.0], [1.0, 2.0]]))
    both = CorrectionCovariance.of_blocks([first, (("fy", "k1"), np.diag([5.0, 6.0]))])
    assert both.of == ("fx", "fy", "k1")
    np.testing.assert_array_equal(both.matrix, np.diag([2.0, 5.0, 6.0]))


def test_poses_go_into_the_cell_and_the_tool_base_stays() -> None:
    bases = CELL.camera_base_in_world.inverse() @ FOUND @ CELL.tool_base_in_world
    corrected = CellCorrection(FOUND, bases).cell(CELL)
    np.testing.assert_allclose(corrected.camera_in_flange.matrix(), FOUND.matrix())
    assert corrected.tool_base_in_world is CELL.tool_base_in_world
    there = corrected.camera_base_in_world @ bases
    np.testing.assert_allclose(there.matrix(), CELL.tool_base_in_world.matrix(), atol=1e-12)
    assert NO_CORRECTION.cell(CELL) is CELL


def test_depth_is_converted_and_nothing_else() -> None:
    color, depth = smooth(LENS)
    depth[3, 4] = np.nan
    read = Frame(7, color, (1.03 * depth - 0.004).astype(np.float32), np.ones((128, 128), np.uint8))
    found = CellCorrection(numbers={"depth_scale": 0.03, "depth_offset": -0.004}).frame(read, LENS)
    np.testing.assert_allclose(found.depth, depth, atol=1e-6)
    assert found.depth.dtype == np.float32 and found.stamp_ns == 7
    np.testing.assert_array_equal(found.color, color)
    np.testing.assert_array_equal(found.mask, read.mask)


@pytest.mark.parametrize(
    "numbers",
    [
        {"fx": 0.04, "fy": -0.03},
        {"cx": 0.03, "cy": -0.02},
        {"k1": -0.3, "k2": 0.05},
        {"fx": 0.03, "fy": 0.02, "cx": -0.02, "cy": 0.02, "k1": 0.15, "k2": -0.05, "p1": 0.01, "p2": -0.008},
    ],
)
def test_what_a_true_lens_sees_becomes_what_was_described(numbers: dict[str, float]) -> None:
    """The world bends images by undistorting rays, the correction by projecting them."""
    of = {name: numbers.get(name, 0.0) for name in ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")}
    plain = draw_instance(InstanceName(), CELL).optics
    optics = replace(
        plain,
        focal=np.array([of["fx"], of["fy"]]),
        centre=np.array([of["cx"], of["cy"]]),
        radial=np.array([of["k1"], of["k2"]]),
        tangential=np.array([of["p1"], of["p2"]]),
    )
    lens = Lens(optics, LENS)
    color, depth = smooth(lens.ideal)
    seen = Frame(0, lens.color(color), lens.depth(depth), np.ones((128, 128), np.uint8))
    found = CellCorrection(numbers=numbers).frame(seen, LENS)
    wanted_color, wanted_depth = smooth(LENS)
    inner = (slice(20, -20), slice(20, -20))
    assert np.abs(found.color[inner].astype(int) - wanted_color[inner]).max() <= 4
    np.testing.assert_allclose(found.depth[inner], wanted_depth[inner], atol=0.002)
    before = np.abs(seen.color[inner].astype(int) - wanted_color[inner]).max()
    assert before > 15  # without it one would see the difference
    assert found.mask[inner].all()


def test_what_the_true_lens_did_not_see_has_no_depth() -> None:
    color, depth = smooth(LENS)
    seen = Frame(0, color, depth, np.ones((128, 128), np.uint8))
    found = CellCorrection(numbers={"cx": 0.1}).frame(seen, LENS)  # the true image lies 12.8 px to the right
    assert np.isnan(found.depth[:, -12:]).all() and not found.mask[:, -12:].any()
    assert np.isfinite(found.depth[:, :-13]).all()


def _with_covariance(of: list[str], matrix: list[list[float]]) -> str:
    about = {"kind": "cell_correction", "schema": 1, "numbers": {"fx": 0.02, "k1": 0.1}}
    return json.dumps({**about, "covariance": {"of": of, "matrix": matrix}})


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("", "JSON"),
        ("[1]", "no correction"),
        ('{"kind": "hand_eye", "schema": 1}', "no correction"),
        ('{"kind": "cell_correction", "schema": 1, "numbers": [1]}', "numbers by name"),
        ('{"kind": "cell_correction", "schema": 1, "numbers": {"zoom": 1}}', "zoom"),
        ('{"kind": "cell_correction", "schema": 1, "numbers": {"fx": 0.9}}', "0.3"),
        ('{"kind": "cell_correction", "schema": 1, "numbers": {"fx": NaN}}', "NaN|finite|nan"),
        ('{"kind": "cell_correction", "schema": 1, "camera_in_flange": 3}', "pose"),
        (_with_covariance(["fx"], [[1e-4, 0.0]]), "shape"),
        (_with_covariance(["fx", "k1"], [[1e-4, 1e-5], [0.0, 1e-4]]), "symmetric"),
        (_with_covariance(["fx", "k1"], [[1e-4, 2e-4], [2e-4, 1e-4]]), "negative"),
        (_with_covariance(["fx"], [[-1e-4]]), "negative"),
        (_with_covariance(["fy"], [[1e-4]]), "'fy', which is not corrected"),
        (_with_covariance(["camera_in_flange.x"], [[1e-6]]), "not corrected"),
        ('{"kind": "cell_correction", "schema": 1, "covariance": 3}', "covariance cannot be read"),
        (
            '{"kind": "cell_correction", "schema": 1, "camera_in_flange":'
            ' {"position": [0, 0, 0], "quat_xyzw": [0, 0, 0, 0]}}',
            "quaternion",
        ),
    ],
)
def test_what_is_no_correction_is_refused(tmp_path: Path, content: str, says: str) -> None:
    path = tmp_path / "cell.json"
    path.write_text(content)
    with pytest.raises(InputError, match=says):
        read_correction(path)


def test_an_empty_name_is_no_correction_and_a_missing_file_is_told(tmp_path: Path) -> None:
    assert correction_of("") is NO_CORRECTION
    with pytest.raises(InputError, match=r"none\.json"):
        correction_of(str(tmp_path / "none.json"))


def test_json_holds_no_nan(tmp_path: Path) -> None:
    write_correction(tmp_path / "cell.json", NO_CORRECTION)
    assert json.loads((tmp_path / "cell.json").read_text())["numbers"] == {}
    assert read_correction(tmp_path / "cell.json").is_empty


def test_rays_beyond_the_fold_of_a_lens_are_not_in_its_image() -> None:
    """r (1 + k1 r^2) comes back from r^2 = 1 / (3 |k1|): nearer the middle than a wide camera's corner."""
    wide = replace(LENS, fx=0.5 * LENS.fx, fy=0.5 * LENS.fy)
    at = find_lens_places({"k1": -0.6}, wide)
    u, v = np.meshgrid(np.arange(wide.width) + 0.5, np.arange(wide.height) + 0.5)
    square = ((u - wide.cx) / wide.fx) ** 2 + ((v - wide.cy) / wide.fy) ** 2
    np.testing.assert_array_equal(at.inside, square < 1 / 1.8)
    assert 0.2 < at.inside.mean() < 0.9
    for mild in ({"k1": 0.53}, {"k1": -0.2, "k2": 0.1}):
        x, y = find_lens_places(mild, LENS).x, find_lens_places(mild, LENS).y
        within = (np.abs(x - 63.5) < 63.0) & (np.abs(y - 63.5) < 63.0)
        assert find_lens_places(mild, LENS).inside[within].all()


def test_a_lens_that_a_camera_may_have_is_corrected_and_a_stranger_one_is_named() -> None:
    assert CellCorrection(numbers={"k1": 0.53}).numbers == {"k1": 0.53}  # that of typical:405
    assert find_beyond({"k1": 0.53, "k2": -0.2}) == ""
    assert "k2 is -1.2, must be within +-1" in find_beyond({"k1": 0.53, "k2": -1.2})
    assert "p1 is nan" in find_beyond({"p1": float("nan")})


def test_a_file_holds_zeros_of_encoders(tmp_path: Path) -> None:
    zeros = {"camera_arm": {CELL.camera_arm.joint_names[5]: 0.015}}
    write_correction(tmp_path / "cell.json", CellCorrection(encoder_zeros=zeros))
    read = read_correction(tmp_path / "cell.json")
    assert read.encoder_zeros == zeros and not read.is_empty
    names = CELL.camera_arm.joint_names
    assert read.zeros(names, "camera_arm").tolist() == [0.0] * 5 + [0.015] + [0.0] * (len(names) - 6)
    assert not read.zeros(CELL.tool_arm.joint_names, "tool_arm").any()


@pytest.mark.parametrize(
    ("zeros", "says"),
    [
        ({"camera_arm": {"joint": 0.2}}, "must be within .*set the joint's zero"),
        ({"camera_arm": {"joint": float("nan")}}, "must be within"),
        ({"third_arm": {"joint": 0.01}}, "no arm 'third_arm'.*camera_arm, tool_arm"),
        ({"camera_arm": [0.01]}, "cannot be read"),
        ([0.01], "cannot be read"),
    ],
)
def test_zeros_that_no_cell_has_are_refused(zeros: object, says: str, tmp_path: Path) -> None:
    path = tmp_path / "cell.json"
    path.write_text(
        json.dumps({"schema": 1, "kind": "cell_correction", "numbers": {}, "encoder_zeros": zeros})
    )
    with pytest.raises(InputError, match=says):
        read_correction(path)
