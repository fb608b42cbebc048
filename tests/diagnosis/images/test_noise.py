"""Noise of tiles: calibrated whatever the tails, and never finer than what was fitted."""

from __future__ import annotations

import numpy as np

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
