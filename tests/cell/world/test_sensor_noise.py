"""The sensor model: noise of the stated size, and nothing when it is switched off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.world.sensor_noise import NO_RGBD_NOISE, RgbdNoise, RgbdSensor
from samrl_core.common.errors import InputError

K = Intrinsics.from_fov(128, 128, np.deg2rad(42.0))


def picture() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A disc at 0.4 m before a wall at 0.6 m, with a strip of nothing at the top."""
    v, u = np.mgrid[0:128, 0:128]
    disc = (v - 64) ** 2 + (u - 64) ** 2 < 30**2
    depth = np.where(disc, 0.4, 0.6)
    depth[:5] = np.nan
    color = np.full((128, 128, 3), 120, dtype=np.uint8)
    return color, depth, disc.astype(np.uint8)


def test_no_noise_changes_nothing() -> None:
    """Every switch at zero gives the image back."""
    color, depth, mask = picture()
    c, d, m = RgbdSensor(NO_RGBD_NOISE, K).read(np.random.default_rng(0), color, depth, mask)
    np.testing.assert_array_equal(c, color)
    np.testing.assert_array_equal(m, mask)
    np.testing.assert_allclose(d, depth, atol=1e-7)
    assert (c.dtype, d.dtype, m.dtype) == (np.uint8, np.float32, np.uint8)


def test_depth_error_grows_with_the_square_of_distance() -> None:
    """Standard deviation is z^2 subpixel / (focal baseline) at two distances."""
    noise = replace(RgbdNoise(), disparity_step=0.0, edge_dropout=0.0, speckle=0.0)
    sensor, rng = RgbdSensor(noise, K), np.random.default_rng(1)
    color, _, mask = picture()
    for z in (0.4, 1.2):
        flat = np.full((128, 128), z)
        errors = np.stack([sensor.read(rng, color, flat, mask)[1] - z for _ in range(20)])
        expected = z**2 * noise.subpixel / (noise.stereo_focal * noise.baseline)
        assert np.std(errors) == pytest.approx(expected, rel=0.05)
        assert abs(np.mean(errors)) < 0.1 * expected


def test_part_of_the_depth_error_is_smooth() -> None:
    """Neighbours' errors correlate by about the correlated share."""
    noise = replace(RgbdNoise(), disparity_step=0.0, speckle=0.0)
    sensor, rng = RgbdSensor(noise, K), np.random.default_rng(2)
    color, _, mask = picture()
    flat = np.full((128, 128), 0.5)
    errors = np.stack([sensor.read(rng, color, flat, mask)[1] - 0.5 for _ in range(20)])
    correlation = np.corrcoef(errors[:, :, :-1].ravel(), errors[:, :, 1:].ravel())[0, 1]
    assert 0.35 < correlation < 0.55


def test_depth_is_lost_at_edges_and_beyond_the_range() -> None:
    """Half of the edge pixels, few others, all of what is too near or too far."""
    color, depth, mask = picture()
    sensor, rng = RgbdSensor(RgbdNoise(), K), np.random.default_rng(3)
    lost = np.mean([np.isnan(sensor.read(rng, color, depth, mask)[1]) for _ in range(30)], axis=0)
    v, u = np.mgrid[0:128, 0:128]
    radius = np.hypot(v - 64, u - 64)
    assert 0.35 < lost[np.abs(radius - 30) < 0.7].mean() < 0.65
    assert lost[np.abs(radius - 30) > 4][lost[np.abs(radius - 30) > 4] < 0.5].mean() < 0.01
    assert (lost[:5] == 1).all()
    for z in (0.1, 3.5):
        assert np.isnan(sensor.read(rng, color, np.full((128, 128), z), mask)[1]).all()


def test_mask_errs_at_its_boundary_only() -> None:
    """Without blobs, labels far from the boundary stay; some at the boundary change."""
    color, depth, mask = picture()
    sensor = RgbdSensor(replace(RgbdNoise(), mask_blobs=0.0), K)
    out = sensor.read(np.random.default_rng(4), color, depth, mask)[2]
    v, u = np.mgrid[0:128, 0:128]
    radius = np.hypot(v - 64, u - 64)
    assert (out != mask)[np.abs(radius - 30) > 4].sum() == 0
    assert (out != mask).sum() > 20


def test_blobs_are_missing_from_the_mask() -> None:
    """With blobs and no boundary errors, labels are only lost, never made."""
    color, depth, mask = picture()
    sensor = RgbdSensor(replace(RgbdNoise(), mask_boundary=0.0, mask_blobs=3.0), K)
    out = sensor.read(np.random.default_rng(5), color, depth, mask)[2]
    assert 0 < (out < mask).sum() < 300
    assert (out > mask).sum() == 0


def test_same_seed_same_reading() -> None:
    """The generator is the only source of chance."""
    color, depth, mask = picture()
    sensor = RgbdSensor(RgbdNoise(), K)
    a = sensor.read(np.random.default_rng(6), color, depth, mask)
    b = sensor.read(np.random.default_rng(6), color, depth, mask)
    for x, y in zip(a, b, strict=True):
        np.testing.assert_array_equal(x, y)


@pytest.mark.parametrize("field", ["baseline", "stereo_focal", "correlation_length"])
def test_lengths_must_be_positive(field: str) -> None:
    """A zero baseline is refused by name."""
    with pytest.raises(InputError, match=field):
        RgbdSensor(replace(RgbdNoise(), **{field: 0.0}), K)


def test_probabilities_must_be_probabilities() -> None:
    """More than certain is refused."""
    with pytest.raises(InputError, match="speckle"):
        RgbdSensor(replace(RgbdNoise(), speckle=1.5), K)
