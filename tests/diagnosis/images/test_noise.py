"""Noise of tiles: calibrated whatever the tails, and never finer than what was fitted."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from samrl_core.cell.types.image_recording import ImageTolerances
from samrl_core.diagnosis.residuals.images.bends import BENDS, bend_modes
from samrl_core.diagnosis.residuals.images.linearisation import most_probable
from samrl_core.diagnosis.residuals.images.noise import AS_ONE, noise_of_rows
from samrl_core.diagnosis.residuals.images.rows import Rows
from samrl_core.diagnosis.residuals.likelihood import Likelihood


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


def test_the_grain_of_a_table_is_no_noise_of_its_depth() -> None:
    """Colours of a frame's tiles are alike; samples of depth, which are not, counted as fewer with them."""
    rng = np.random.default_rng(0)
    frames, tiles, depth = 24, 60, rng.standard_normal(1440)
    grain = rng.standard_normal((frames, tiles))
    for k in range(1, tiles):
        grain[:, k] = 0.6 * grain[:, k - 1] + 0.8 * grain[:, k]
    color = 0.1 * np.tile(grain[:, None], (1, 3, 1)).ravel()
    rows = {
        "depth": Rows(
            1e-3 * depth, np.zeros(1440, dtype=int), np.ones(1440), {"depth_offset": np.ones((1, 1440))}
        ),
        "color": Rows(
            color, np.zeros(len(color), dtype=int), np.ones(len(color)), {"light": np.ones((1, len(color)))}
        ),
    }
    _, sigma, _ = noise_of_rows(rows, {})
    made = cast(Any, object.__new__(Likelihood))
    made.y = np.concatenate([rows[c].value / sigma[c] for c in rows])
    made.blocks = {(0, "depth", 0): slice(0, 1440), (0, "color", 0): slice(1440, len(made.y))}
    made._basis, made._strength = np.zeros((len(made.y), 0)), np.zeros(0)
    assert made.correlation_time(made.y) < 1.7
    alike = np.concatenate([made.y[:1440], made.y[1440:] * np.sqrt(AS_ONE["color"])])
    assert made.correlation_time(alike) > 2.4, "nothing is alike: the test shows nothing"
