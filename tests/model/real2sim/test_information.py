"""Fisher information and fusion, on an image that is known in closed form."""

from __future__ import annotations

import gc
import sys

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_core.model.real2sim.information import (
    ImageNoise,
    TargetImage,
    fused,
    newton_step,
    view_information,
)
from samrl_core.model.real2sim.target_cloud import eroded, target_cloud

QUIET = ImageNoise(registration=1e-6)


def blob(values: np.ndarray) -> TargetImage:
    """A smooth spot at (20 + a, 24 + b) px before a sloping wall; a, b are the parameters."""
    v, u = np.mgrid[0:48, 0:48] + 0.5
    spot = np.exp(-((u - 20 - values[0]) ** 2 + (v - 24 - values[1]) ** 2) / (2 * 5.0**2))
    return TargetImage(np.repeat(spot[..., None], 3, axis=-1), np.full(u.shape, 0.4), spot > 0.3)


def test_step_recovers_a_small_move() -> None:
    """From 0.4 px away to 0.02 px in two steps, without noise."""
    truth, at = np.array([0.3, -0.25]), np.zeros(2)
    for _ in range(2):
        at = at + newton_step(view_information(blob, at, np.full(2, 0.3), QUIET), blob(truth))
    np.testing.assert_allclose(at, truth, atol=0.02)


def test_step_withstands_a_hole_in_the_mask() -> None:
    """A lost blob of nine pixels moves the answer by less than a fifth of a pixel."""
    real = blob(np.zeros(2))
    color, mask = real.color.copy(), real.mask.copy()
    color[22:25, 22:25], mask[22:25, 22:25] = 0.0, False
    view = view_information(blob, np.zeros(2), np.full(2, 0.3), QUIET)
    assert np.abs(newton_step(view, TargetImage(color, real.depth, mask))).max() < 0.2


def test_shift_of_the_image_bounds_what_a_view_can_tell() -> None:
    """Parameters that are a shift themselves cannot be known better than the registration."""
    noise = ImageNoise(registration=0.5)
    view = view_information(blob, np.zeros(2), np.full(2, 0.3), noise)
    deviation = np.sqrt(np.diag(np.linalg.inv(view.matrix)))
    assert (deviation >= 0.49).all()
    quiet = view_information(blob, np.zeros(2), np.full(2, 0.3), QUIET)
    assert (np.sqrt(np.diag(np.linalg.inv(quiet.matrix))) < 0.3).all()


def test_nothing_in_sight_tells_nothing() -> None:
    """An image without target: information zero, and fusion leaves the belief."""

    def nothing(values: np.ndarray) -> TargetImage:
        return TargetImage(np.zeros((8, 8, 3)), np.full((8, 8), np.inf), np.zeros((8, 8), dtype=bool))

    view = view_information(nothing, np.zeros(2), np.ones(2), QUIET)
    assert view.pixels == 0
    np.testing.assert_array_equal(view.matrix, np.zeros((2, 2)))
    mean, covariance = fused(np.ones(2), np.eye(2), np.full(2, 9.0), view.matrix, 9.0)
    np.testing.assert_allclose(mean, np.ones(2))
    np.testing.assert_allclose(covariance, np.eye(2))


def test_fusion_is_the_product_of_gaussians() -> None:
    """Two equal beliefs meet in the middle with half the covariance; a blind direction stays."""
    mean, covariance = fused(np.zeros(2), np.eye(2), np.array([1.0, 5.0]), np.diag([1.0, 0.0]), 9.0)
    np.testing.assert_allclose(mean, [0.5, 0.0], atol=1e-12)
    np.testing.assert_allclose(covariance, np.diag([0.5, 1.0]), atol=1e-12)


def test_surprise_widens_the_belief() -> None:
    """A fit a hundred deviations off wins."""
    mean, _ = fused(np.zeros(1), np.array([[1e-6]]), np.array([0.1]), np.array([[1e6]]), 9.0)
    assert mean[0] > 0.09


def test_refuses_bad_input() -> None:
    """Steps that are not positive, covariances that are not definite, clouds and masks that do not fit."""
    with pytest.raises(InputError):
        view_information(blob, np.zeros(2), np.zeros(2), QUIET)
    with pytest.raises(InputError):
        fused(np.zeros(2), np.zeros((2, 2)), np.zeros(2), np.eye(2), 9.0)
    with pytest.raises(InputError):
        eroded(np.zeros((3, 3)))
    with pytest.raises(InputError):
        target_cloud(np.zeros((4, 4, 3)), np.zeros((3, 3), dtype=bool))


def test_erosion_takes_one_pixel_and_keeps_the_border() -> None:
    """A 5 x 5 square loses its rim; a mask that touches the image border keeps it there."""
    mask = np.zeros((9, 9), dtype=bool)
    mask[2:7, 2:7] = True
    assert eroded(mask).sum() == 9
    assert eroded(np.ones((4, 4), dtype=bool)).all()


def test_forward_differences_agree_with_central_ones() -> None:
    """Within a fifth: enough to rank views."""
    both = [
        view_information(blob, np.zeros(2), np.full(2, 0.3), QUIET, central=side).matrix
        for side in (True, False)
    ]
    np.testing.assert_allclose(np.diag(both[1]), np.diag(both[0]), rtol=0.2)


def test_images_of_ever_new_sizes_leave_nothing_behind() -> None:
    """A node of hours sees thousands of targets, each of another number of pixels."""

    def disc(radius: float) -> TargetImage:
        v, u = np.mgrid[0:96, 0:96] + 0.5
        inside = (u - 48) ** 2 + (v - 48) ** 2 < radius**2
        return TargetImage(inside[..., None] * np.full(3, 0.5), np.full(u.shape, 0.4), inside)

    def look(radius: float) -> None:
        view = view_information(lambda v: disc(radius + v[0]), np.zeros(1), np.full(1, 0.3), QUIET)
        newton_step(view, disc(radius))

    for number in range(60):  # some hundred blocks for numpy's own free lists
        look(8.0 + 0.2 * number)
    gc.collect()
    before = sys.getallocatedblocks()
    for number in range(60, 160):
        look(8.0 + 0.2 * number)
    gc.collect()
    assert sys.getallocatedblocks() - before < 500  # 5,500 when something of each number of pixels was kept
