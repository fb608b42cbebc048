"""Photos of a body on the table: where it stands, with the cell's noise, the same for a seed."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks.peg_insertion.board import board_body
from samrl_core.cell.types.camera import Camera
from samrl_core.cell.types.pose import Pose, look_at
from samrl_core.cell.world.pybullet.body_photos import BodyPhotos

PLACE = Pose(np.array([0.5, 0.1, 0.0]), np.array([0.0, 0.0, 0.0, 1.0]))
BODY = board_body("board", 0.012, 0.06, 0.04, PLACE, 1, 0.3)
CAMERA = Camera(cell_named().intrinsics, look_at(np.array([0.8, 0.2, 0.3]), np.array([0.5, 0.1, 0.02])))


@pytest.fixture(scope="module")
def photos() -> Iterator[BodyPhotos]:
    made = BodyPhotos(BODY)
    yield made
    made.close()
    made.close()


def test_the_body_stands_on_the_table(photos: BodyPhotos) -> None:
    picture = photos.perfect(CAMERA)
    points = CAMERA.unproject(picture.depth)
    body = points[picture.mask == 1]
    assert len(body) > 1000
    assert np.abs(body[:, :2] - PLACE.position[:2]).max() < 0.0625  # a corner of 16 sides
    assert body[:, 2].max() == pytest.approx(0.04, abs=1e-3)
    table = points[(picture.mask == 0) & np.isfinite(picture.depth)]
    assert len(table) > 1000 and np.abs(table[:, 2]).max() < 1e-3


def test_readings_have_the_sensors_noise_and_repeat_with_the_seed(photos: BodyPhotos) -> None:
    first, again, other = (photos.read(CAMERA, np.random.default_rng(seed)) for seed in (3, 3, 4))
    for name in ("color", "depth", "mask"):
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))
    assert (first.color != other.color).any() and (first.mask != other.mask).any()
    perfect = photos.perfect(CAMERA)
    error = (first.depth - perfect.depth)[(first.mask == 1) & (perfect.mask == 1)]
    assert 2e-4 < np.nanstd(error) < 1.5e-3  # 0.3 mm to 0.6 mm at 0.3 m to 0.4 m, and the step of disparity
    assert np.isnan(error).any()
