"""Point clouds of a wall, a folder for each distance: read as depth images are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_ros.log_import.devices import data_folder
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.formats.depth_images import read_depth_images
from samrl_ros.log_import.formats.point_clouds import read_cloud
from samrl_ros.log_import.specs import ImageOptions

DISTANCES = (0.5, 0.8, 1.3)
FACTOR = 1.02  # by which the sensor reads too far


def cloud(distance: float, turned: bool, rng: np.random.Generator) -> np.ndarray:
    """Points (3000, 3) on a wall that leans a little, as a sensor gives them; z backward where turned."""
    rays = np.column_stack([rng.uniform(-0.8, 0.8, 3000), rng.uniform(-0.5, 0.5, 3000), np.ones(3000)])
    normal = np.array([0.03, -0.02, 1.0]) / np.linalg.norm([0.03, -0.02, 1.0])
    depth = FACTOR * distance / (rays @ normal) + rng.normal(0.0, 1e-3, 3000)
    depth[:30] *= 0.7  # flying points
    return rays * depth[:, None] * (np.array([1.0, -1.0, -1.0]) if turned else 1.0)


def write(path: Path, points: np.ndarray) -> Path:
    path.parent.mkdir(exist_ok=True, parents=True)
    axes = "".join(f"property float {axis}\n" for axis in "xyz")
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n{axes}end_header\n"
    path.write_bytes(head.encode() + points.astype("<f4").tobytes())
    return path


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("scale", [1.0, 1000.0])
def test_clouds_of_a_wall_read_how_far_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, turned: bool, scale: float
) -> None:
    """They were no log; and `.`, where a user mostly is, had no name."""
    rng = np.random.default_rng(11)
    for distance in DISTANCES:
        write(tmp_path / "wall" / f"{distance}m" / "cloud_0.ply", scale * cloud(distance, turned, rng))
    monkeypatch.chdir(tmp_path / "wall")
    drafted = draft_any([Path()], None, None)
    assert not drafted.questions and drafted.recordings[0]["name"] == "wall"
    source = drafted.sources["log"]
    assert data_folder(drafted, Path()) / source["file"] == tmp_path / "wall"
    table = read_depth_images(tmp_path / "wall", ImageOptions(**source["images"]), "the log")
    stated, read = table.numbers("named_distance", ""), table.numbers("plane_distance", "")
    for distance in DISTANCES:
        assert np.median(read[stated == distance]) / distance == pytest.approx(FACTOR, abs=2e-3)


def write_pcd(path: Path, points: np.ndarray, kind: str, viewpoint: str = "0 0 0 1 0 0 0") -> Path:
    """A PCD file of points (N, 3) with a normal of three numbers before x, and colours behind z."""
    path.parent.mkdir(exist_ok=True, parents=True)
    head = "VERSION 0.7\nFIELDS normal x y z rgb\nSIZE 4 4 8 4 4\nTYPE F F F F U\nCOUNT 3 1 1 1 1\n"
    head += f"WIDTH {len(points)}\nHEIGHT 1\nVIEWPOINT {viewpoint}\nPOINTS {len(points)}\nDATA {kind}\n"
    layout = np.dtype([("n", "<f4", 3), ("x", "<f4"), ("y", "<f8"), ("z", "<f4"), ("rgb", "<u4")])
    rows = np.array([((0.0, 0.0, 1.0), x, y, z, 0) for x, y, z in points], layout)
    lines = "".join(f"0 0 1 {x:.6g} {y:.6g} {z:.6g} 4278190080\n" for x, y, z in points)
    path.write_bytes(
        f"# .PCD v0.7\n{head}".encode() + (lines.encode() if kind == "ascii" else rows.tobytes())
    )
    return path


@pytest.mark.parametrize("kind", ["ascii", "binary"])
def test_clouds_of_the_point_cloud_library_are_read(tmp_path: Path, kind: str) -> None:
    """A folder of them was no log, or a text with too many columns."""
    rng = np.random.default_rng(14)
    for distance in DISTANCES:
        write_pcd(tmp_path / f"{distance}m.pcd", cloud(distance, False, rng), kind)
    drafted = draft_any([tmp_path], None, None)
    assert not drafted.questions and drafted.readings["quantity"] == "depth"
    table = read_depth_images(tmp_path, ImageOptions(**drafted.sources["log"]["images"]), "the log")
    stated, read = table.numbers("named_distance", ""), table.numbers("plane_distance", "")
    assert np.median(read / stated) == pytest.approx(FACTOR, abs=2e-3)


def test_a_damaged_or_unusual_pcd_file_is_refused(tmp_path: Path) -> None:
    points = cloud(1.0, False, np.random.default_rng(15))
    cut = write_pcd(tmp_path / "cut.pcd", points, "binary")
    cut.write_bytes(cut.read_bytes()[:-900])
    packed = write_pcd(tmp_path / "packed.pcd", points, "binary_compressed")
    moved = write_pcd(tmp_path / "moved.pcd", points, "ascii", viewpoint="1 0 0 1 0 0 0")
    headless = tmp_path / "headless.pcd"
    headless.write_text("VERSION 0.7\n1 2 3\n")
    for path, told in (
        (cut, "is it whole"),
        (packed, "pcl_convert_pcd_ascii_binary packed.pcd"),
        (moved, "VIEWPOINT 1 0 0"),
        (headless, "no line DATA"),
    ):
        with pytest.raises(InputError, match=told):
            read_cloud(path, "the log")


def test_one_cloud_alone_says_what_a_recording_is(tmp_path: Path) -> None:
    path = write_pcd(tmp_path / "scene.pcd", cloud(1.0, False, np.random.default_rng(16)), "ascii")
    with pytest.raises(InputError, match="a cloud tells no motion"):
        draft_any([path], None, None)


def test_a_cloud_around_its_sensor_is_refused(tmp_path: Path) -> None:
    points = np.random.default_rng(12).normal(size=(900, 3))
    with pytest.raises(InputError, match="before and behind"):
        read_cloud(write(tmp_path / "room.ply", points), "the log")


def test_a_cloud_cut_short_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "wall.ply", cloud(1.0, False, np.random.default_rng(13)))
    path.write_bytes(path.read_bytes()[:900])
    with pytest.raises(InputError, match=r"wall\.ply"):
        read_cloud(path, "the log")
