"""A part's share of each pixel is found by colours, whatever its mask is wrong by."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_core.model.real2sim.coverage import coverage

RED, BLUE = np.array([0.8, 0.1, 0.1]), np.array([0.2, 0.4, 0.8])


def upright_line(middle: float, width: float = 1.3, size: int = 40) -> np.ndarray:
    """Share of each pixel (H, W) that an upright line covers; pixel i is from i to i + 1."""
    edge = np.arange(size)
    share = np.minimum(edge + 1, middle + 0.5 * width) - np.maximum(edge, middle - 0.5 * width)
    rows = np.tile(np.clip(share, 0.0, 1.0), (size, 1))
    rows[:8] = rows[-8:] = 0.0
    return rows


def photographed(share: np.ndarray, seed: int = 0) -> np.ndarray:
    """A red part before a table of two greys, with noise."""
    rng = np.random.default_rng(seed)
    table = np.where(np.arange(share.shape[0])[:, None, None] < 20, 0.6, 0.35) * np.ones(3)
    image = share[..., None] * RED + (1.0 - share[..., None]) * table
    return np.clip(image + rng.normal(0.0, 0.01, image.shape), 0.0, 1.0)


@pytest.mark.parametrize("aside", [-1, 0, 1])
def test_a_line_lies_where_its_colour_is_though_its_mask_lies_beside(aside: int) -> None:
    share = upright_line(20.3)
    mask = np.roll(share > 0.1, aside, axis=1)
    found = coverage(photographed(share), mask, thin=True)
    middle = (found * (np.arange(40) + 0.5)).sum(axis=1)[8:-8] / found.sum(axis=1)[8:-8]
    assert np.abs(middle - 20.3).max() < 0.25  # the mask is a pixel off
    np.testing.assert_allclose(found[8:-8].sum(axis=1), 1.3, atol=0.25)
    assert found[:6].max() < 0.2 and found[-6:].max() < 0.2  # it ends where the colour ends


def test_a_line_whose_mask_has_holes_and_ends_early_is_followed_to_its_end() -> None:
    """A segmenter whose boundaries lie inwards leaves some pixels of a thread, and none of its last rows."""
    share = upright_line(20.3)
    mask = (share > 0.6) & (np.arange(40)[:, None] < 22)
    mask[11:15] = mask[17:20] = False
    found = coverage(photographed(share), mask, thin=True)
    np.testing.assert_allclose(found[8:-8].sum(axis=1), 1.3, atol=0.25)
    assert found[:6].max() < 0.2 and found[-6:].max() < 0.2


def test_a_wide_part_of_two_colours_is_found_within_a_mask_that_is_too_large() -> None:
    share = np.zeros((40, 40))
    share[15:25, 15:25] = 1.0
    image = photographed(share)
    image[15:25, 20:25] = BLUE
    mask = np.zeros((40, 40), dtype=bool)
    mask[14:26, 14:26] = True
    found = coverage(image, mask, thin=False)
    assert found[share > 0].min() > 0.8 and found[share == 0].max() < 0.2


def test_where_colours_are_alike_the_mask_stands() -> None:
    mask = np.zeros((40, 40), dtype=bool)
    mask[10:30, 19:22] = True
    found = coverage(np.full((40, 40, 3), 0.5), mask, thin=True)
    np.testing.assert_array_equal(found, mask.astype(np.float64))


def test_images_of_two_sizes_are_refused() -> None:
    with pytest.raises(InputError, match="one image"):
        coverage(np.zeros((8, 8, 3)), np.zeros((8, 9), dtype=bool), thin=True)
