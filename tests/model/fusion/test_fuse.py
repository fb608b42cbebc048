"""A ball is recovered from its pictures, closed and coloured; what cannot be fused is named."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.types.camera import Camera
from samrl_core.cell.types.pose import Pose, look_at
from samrl_core.common.errors import InputError
from samrl_core.model.fusion.fuse import FusedMesh, FusionSettings, fuse
from samrl_core.model.fusion.masked_view import MaskedView, corner_weights
from samrl_core.model.scene.mesh_checks import mesh_faults
from tests.model.fusion.ball import CENTER, RADIUS, K, cameras, photo, photos

FINE = FusionSettings(voxel_size=0.002)


@pytest.fixture(scope="module")
def ball() -> FusedMesh:
    return fuse(photos(), FINE)


def error(mesh: FusedMesh) -> np.ndarray:
    return np.abs(np.linalg.norm(mesh.vertices - CENTER, axis=1) - RADIUS)


def test_a_ball_keeps_its_radius(ball: FusedMesh) -> None:
    """A pixel is 1.8 mm wide there."""
    assert error(ball)[ball.observed].mean() < 3e-4
    assert error(ball)[ball.observed].max() < 2e-3


def test_the_surface_is_closed_manifold_and_wound_outwards(ball: FusedMesh) -> None:
    found = mesh_faults(ball.vertices, ball.faces)
    assert (found.flat_faces, found.branching_edges, found.open_edges, found.turned_edges) == (0, 0, 0, 0)
    assert found.volume == pytest.approx(4 / 3 * math.pi * RADIUS**3, rel=0.03)


def test_what_no_camera_saw_is_closed_above_the_floor_and_said(ball: FusedMesh) -> None:
    assert ball.vertices[:, 2].min() > -1e-6
    assert ball.observed[ball.vertices[:, 2] > RADIUS].all()
    assert not ball.observed[ball.vertices[:, 2] < 0.002].any()


def test_colors_lie_where_they_were_seen(ball: FusedMesh) -> None:
    expected = 0.5 + 0.5 * (ball.vertices - CENTER) / RADIUS
    assert np.abs(ball.color - expected)[ball.observed].mean() < 0.02


def test_without_a_background_the_masks_alone_carve() -> None:
    """A thing that hangs in nothing: outside the mask depth is NaN."""
    mesh = fuse(photos(table=False), replace(FINE, floor_height=-math.inf))
    assert error(mesh)[mesh.observed].mean() < 3e-4
    assert mesh_faults(mesh.vertices, mesh.faces).open_edges == 0


def test_half_of_the_depth_lost_changes_little() -> None:
    rng = np.random.default_rng(0)
    views = [replace(v, depth=np.where(rng.random(v.depth.shape) < 0.5, np.nan, v.depth)) for v in photos()]
    mesh = fuse(views, FINE)
    assert error(mesh)[mesh.observed].mean() < 6e-4


def test_an_occluder_hides_and_does_not_carve() -> None:
    """A board before the left half of every second picture, in depth and not in the mask."""
    views = []
    for number, view in enumerate(photos()):
        if number % 2:
            left = np.arange(K.width)[None, :] < K.width // 2
            depth = np.where(left, 0.2, view.depth)
            view = replace(view, depth=depth, mask=view.mask & ~left)
        views.append(view)
    mesh = fuse(views, FINE)
    assert error(mesh)[mesh.observed].mean() < 4e-4


def test_a_background_in_one_mask_does_not_blow_up_the_grid() -> None:
    views = photos()
    views[0].mask[:20, :20] = True  # the far table
    small = replace(FINE, max_voxels=200_000)
    assert error(fuse(views, small)).mean() < 1.5e-3


def test_the_same_input_gives_the_same_bits(ball: FusedMesh) -> None:
    again = fuse(photos(), FINE)
    assert np.array_equal(again.vertices, ball.vertices) and np.array_equal(again.color, ball.color)


def test_no_views() -> None:
    with pytest.raises(InputError, match="no views"):
        fuse([])


def test_an_empty_mask() -> None:
    view = photo(cameras(1)[0])
    with pytest.raises(InputError, match=r"mask is empty: 0 of 9216 pixels.*leave the view out"):
        replace(view, mask=np.zeros_like(view.mask))


def test_depth_that_is_nan_everywhere_or_zero() -> None:
    view = photo(cameras(1)[0])
    with pytest.raises(InputError, match=r"none of the \d+ pixels in the mask has a depth, all are NaN"):
        replace(view, depth=np.full_like(view.depth, np.nan))
    with pytest.raises(
        InputError, match=r"not positive and finite \(first 0\.0\); unmeasured depth must be NaN"
    ):
        replace(view, depth=np.zeros_like(view.depth))


def test_images_that_do_not_fit() -> None:
    view = photo(cameras(1)[0])
    with pytest.raises(InputError, match="the camera's images are"):
        replace(view, depth=view.depth[1:])
    with pytest.raises(InputError, match="must be boolean"):
        replace(view, mask=view.mask.astype(np.uint8))


def test_a_camera_inside() -> None:
    inside = photo(Camera(K, look_at(CENTER, CENTER + [1.0, 0.0, 0.2])))
    assert inside.mask.all()
    with pytest.raises(InputError, match=r"camera of view 4 at .* is inside the thing"):
        fuse([*photos(4), inside], FINE)


def test_wrong_poses_are_noticed() -> None:
    """As if the camera poses of another recording were taken."""
    views = photos(6)
    turned = [replace(v, camera=w.camera) for v, w in zip(views, views[2:] + views[:2], strict=True)]
    rng = np.random.default_rng(0)
    shifted = [
        replace(
            v,
            camera=Camera(
                K,
                Pose(
                    v.camera.camera_in_world.position + rng.normal(0, 0.1, 3),
                    v.camera.camera_in_world.quat_xyzw,
                ),
            ),
        )
        for v in turned
    ]
    with pytest.raises(InputError, match=r"measured points of the thing lie in the other views' masks"):
        fuse(shifted, FINE)


def test_too_many_voxels_names_a_size_that_fits() -> None:
    tiny = FusionSettings(voxel_size=0.0005, max_voxels=100_000)
    with pytest.raises(InputError, match=r"the limit is 100000; take voxels of 0\.00"):
        fuse(photos(4), tiny)


@pytest.mark.parametrize("bad", [{"voxel_size": 0.0}, {"truncation": 0.002}, {"voxel_size": float("nan")}])
def test_bad_settings(bad: dict[str, float]) -> None:
    with pytest.raises(InputError, match="at least two voxels"):
        FusionSettings(**bad)


def test_outline_distance_is_that_of_a_straight_edge() -> None:
    view = photo(cameras(1)[0])
    mask = np.zeros_like(view.mask)
    mask[:, 40:] = True
    depth = np.full_like(view.depth, 0.5)
    px = MaskedView(view.color, depth, mask, view.camera).inside_px()
    assert np.allclose(px, np.arange(K.width)[None, :] + 0.5 - 40.0)


def test_between_pixels_a_linear_image_is_exact() -> None:
    image = np.arange(5)[:, None] * 10.0 + np.arange(7)[None, :]
    u, v = np.array([0.5, 3.2, 5.9]), np.array([0.5, 2.7, 4.1])
    pixels, share = corner_weights(u, v, image.shape)
    assert np.allclose((image.reshape(-1)[pixels] * share).sum(axis=0), (v - 0.5) * 10 + u - 0.5)
    assert np.allclose(share.sum(axis=0), 1.0)
