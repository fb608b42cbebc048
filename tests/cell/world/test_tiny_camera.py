"""TinyRenderer against geometry: every pixel of a known mesh, metric depth, labels."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pybullet
import pytest

from samrl_core.cell.tasks.peg_insertion.board import board_body
from samrl_core.cell.tasks.shapes import SIDES
from samrl_core.cell.types.camera import Camera, Intrinsics
from samrl_core.cell.types.pose import Pose, look_at
from samrl_core.cell.world.pybullet.body_files import write_body_urdf
from samrl_core.cell.world.pybullet.camera import Picture, TinyCamera

HOLE, OUTER, HEIGHT = 0.012, 0.06, 0.04
CENTRE = np.array([0.52, -0.02, 0.0])
LABEL = 7
# Off-centre principal point and unequal focal lengths: a sign error in either would show.
K = Intrinsics(160, 120, 180.0, 170.0, 90.0, 50.0)
VIEW = Camera(K, look_at(np.array([0.75, 0.25, 0.30]), np.array([0.5, 0.0, 0.04]), roll=0.4))


@pytest.fixture(scope="module")
def picture(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Picture]:
    """The block alone, floating in nothing."""
    folder: Path = tmp_path_factory.mktemp("body")
    client = pybullet.connect(pybullet.DIRECT)
    pose = Pose(CENTRE, np.array([0.0, 0.0, 0.0, 1.0]))
    urdf = write_body_urdf(board_body("board", HOLE, OUTER, HEIGHT, pose, LABEL, 0.3), folder)
    body = pybullet.loadURDF(str(urdf), CENTRE.tolist(), useFixedBase=True, physicsClientId=client)
    camera = TinyCamera(client, K, {(body, -1): LABEL}, (0.6, 0.4, 1.2), shadow=False)
    yield camera.render(VIEW.camera_in_world)
    pybullet.disconnect(physicsClientId=client)


def rays() -> tuple[np.ndarray, np.ndarray]:
    """Camera position and the ray through each pixel centre, one metre deep."""
    far = VIEW.unproject(np.ones((K.height, K.width)))
    origin = VIEW.camera_in_world.position
    return origin, far - origin


def apothem(points: np.ndarray) -> np.ndarray:
    """Distance from the block's axis in the measure of its polygon."""
    angle = 2 * np.pi / SIDES * np.arange(SIDES)
    return ((points[..., :2] - CENTRE[:2]) @ np.stack([np.cos(angle), np.sin(angle)])).max(-1)


def test_top_plane_is_seen_at_exactly_its_pixels(picture: Picture) -> None:
    """Top-coloured pixels are those whose ray meets the top face."""
    origin, direction = rays()
    depth = (HEIGHT - origin[2]) / direction[..., 2]
    radius = apothem(origin + direction * depth[..., None])
    expected = (radius < OUTER) & (radius > HOLE)
    red, _, blue = (picture.color[..., i].astype(int) for i in range(3))
    seen = (picture.mask == LABEL) & (red > 120) & (red > 3 * blue)
    assert expected.sum() > 500
    assert (seen != expected).sum() <= 3  # rounding at the polygon's corners


def test_depth_is_metric(picture: Picture) -> None:
    """Within 1 mm of the top face, wherever it is seen."""
    origin, direction = rays()
    depth = (HEIGHT - origin[2]) / direction[..., 2]
    radius = apothem(origin + direction * depth[..., None])
    inside = (radius < OUTER - 0.002) & (radius > HOLE + 0.002)
    assert np.abs(picture.depth - depth)[inside].max() < 1e-3


def test_unprojected_top_lies_in_its_plane(picture: Picture) -> None:
    """Depth, intrinsics and pose agree."""
    points = VIEW.unproject(picture.depth)
    radius = apothem(points)
    top = (picture.mask == LABEL) & (radius < OUTER - 0.002) & (radius > HOLE + 0.002)
    top &= points[..., 2] > HEIGHT - 0.005
    assert top.sum() > 500
    assert np.abs(points[top][:, 2] - HEIGHT).max() < 1e-3


def test_known_points_land_on_their_pixels(picture: Picture) -> None:
    """3 mm (1.5 px) inside of the top's corners the top is seen, 3 mm outside of the far ones nothing."""
    angle = np.pi / SIDES + 2 * np.pi / SIDES * np.arange(SIDES)
    away = CENTRE - VIEW.camera_in_world.position
    for reach, far_only in ((OUTER - 0.003, False), (OUTER / np.cos(np.pi / SIDES) + 0.003, True)):
        around = np.stack([np.cos(angle), np.sin(angle), np.zeros(SIDES)], axis=1)
        around = around[around @ away > 0.1] if far_only else around
        u, v, z = VIEW.project(CENTRE + [0.0, 0.0, HEIGHT] + reach * around).T
        row, column = np.floor(v).astype(int), np.floor(u).astype(int)
        assert len(row) >= 5
        if far_only:
            assert (picture.mask[row, column] == 0).all()
        else:
            assert (np.abs(picture.depth[row, column] - z) < 0.003).all()


def test_what_is_not_there_has_no_depth(picture: Picture) -> None:
    """Empty pixels: NaN, label 0; and only those."""
    np.testing.assert_array_equal(np.isnan(picture.depth), picture.mask == 0)
    assert picture.color.dtype == np.uint8 and picture.mask.dtype == np.uint8


def test_faces_are_flat_and_of_three_colors(picture: Picture) -> None:
    """One shade on the whole top: no normals averaged over its edge."""
    points = VIEW.unproject(picture.depth)
    radius = apothem(points)
    top = (picture.mask == LABEL) & (radius < OUTER - 0.001) & (radius > HOLE + 0.001)
    top &= points[..., 2] > HEIGHT - 0.001
    assert np.ptp(picture.color[top].astype(int), axis=0).max() <= 12
    bore = (picture.mask == LABEL) & (radius < HOLE + 0.0005) & (points[..., 2] < HEIGHT - 0.004)
    assert bore.sum() > 5
    red, blue = picture.color[bore][:, 0].astype(int), picture.color[bore][:, 2].astype(int)
    assert (blue > red).all()
