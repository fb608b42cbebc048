"""Noise of tiles: calibrated whatever the tails, and never finer than what was fitted."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.types.image_recording import ImageTolerances
from samrl_core.diagnosis.residuals.images.bends import BENDS, bend_modes
from samrl_core.diagnosis.residuals.images.linearisation import most_probable
from samrl_core.diagnosis.residuals.images.noise import noise_of_rows
from samrl_core.diagnosis.residuals.images.rows import Rows


def _rows(seed: int, wild: float, size: float = 0.002) -> dict[str, Rows]:
    rng = np.random.default_rng(seed)
    value = size * rng.standard_normal(3000)
    value[rng.random(3000) < wild] *= 20.0
    columns = {"depth_offset": np.ones((1, 3000))}
    return {"depth": Rows(value, np.zeros(3000, dtype=int), np.ones(3000), columns)}


def test_tails_leave_no_energy_beyond_noise() -> None:
    for wild in (0.0, 0.05, 0.15):
        rows = _rows(1, wild)
        level, sigma, apart = noise_of_rows(rows, {})
        assert abs(np.mean((rows["depth"].value / sigma["depth"]) ** 2) - 1.0) < 0.05, wild
        assert 0.9 < level["depth"] / 0.002 < 1.5
        assert (apart["depth"] > 0) == (wild > 0)


def test_no_recording_has_finer_noise_than_the_fitted_one() -> None:
    quiet, loud = _rows(1, 0.0), _rows(2, 0.0, 0.005)
    fitted, _, _ = noise_of_rows(loud, {})
    other, _, _ = noise_of_rows(quiet, fitted)
    assert other["depth"] == fitted["depth"]
    first, _, _ = noise_of_rows(quiet, {})
    second, _, _ = noise_of_rows(loud, first)
    assert second["depth"] > 2.0 * first["depth"]


def test_one_large_error_is_not_spread_over_those_that_look_like_it() -> None:
    """A lens' centre far beyond tolerance, beside a hand-eye that moves rows nearly alike."""
    rng = np.random.default_rng(3)
    along, across = rng.standard_normal((2, 600))
    rows = Rows(
        0.03 * along + 0.002 * rng.standard_normal(600), np.zeros(600, dtype=int), np.ones(600),
        {
            "centre": np.stack([along, np.zeros(600)]),
            "hand_eye": np.stack([along + 0.05 * across, *np.zeros((5, 600))]),
            "base": np.stack([along - 0.05 * across, *np.zeros((5, 600))]),
        },
    )  # fmt: skip
    found = most_probable({"depth": rows}, ImageTolerances())
    assert abs(found["centre"][0] - 0.03) < 0.003
    assert np.abs(found["hand_eye"]).max() < 0.002 > np.abs(found["base"]).max()


def test_bends_have_the_size_that_their_tolerance_states() -> None:
    right, below = np.meshgrid(np.linspace(-1.0, 1.0, 201), np.linspace(-1.0, 1.0, 201))
    modes = bend_modes(right, below)
    assert 2 * len(modes) == BENDS
    np.testing.assert_allclose((modes**2).mean(axis=(1, 2)), 1.0, rtol=0.05)
