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


def test_a_cloud_around_its_sensor_is_refused(tmp_path: Path) -> None:
    points = np.random.default_rng(12).normal(size=(900, 3))
    with pytest.raises(InputError, match="before and behind"):
        read_cloud(write(tmp_path / "room.ply", points), "the log")


def test_a_cloud_cut_short_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "wall.ply", cloud(1.0, False, np.random.default_rng(13)))
    path.write_bytes(path.read_bytes()[:900])
    with pytest.raises(InputError, match=r"wall\.ply"):
        read_cloud(path, "the log")
