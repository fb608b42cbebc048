"""The mended mask of a thread, on a picture that is known to the pixel."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_core.model.real2sim.thin_mask import thin_mask

V, U = np.mgrid[0:60, 0:40]
THREAD = (np.abs(U - 18 - 0.1 * V) < 1.2) & (V > 5) & (V < 50)


def picture(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A red thread 5 mm a row farther away, before a grey wall; half of the depth at its edges is lost."""
    rng = np.random.default_rng(seed)
    color = np.where(THREAD[..., None], [0.8, 0.1, 0.1], [0.5, 0.5, 0.5]) + rng.normal(0, 0.01, (60, 40, 3))
    depth = np.where(THREAD, 0.3 + 0.004 * V, 0.8)
    near = THREAD | np.roll(THREAD, 1, 1) | np.roll(THREAD, -1, 1)
    depth[near & (rng.random(depth.shape) < 0.5)] = np.nan
    return color, depth


@pytest.mark.parametrize("shift", [-1, 1, 2])
def test_a_mask_that_is_off_is_put_right(shift: int) -> None:
    """Shifted sideways it showed half background or, by two pixels, next to nothing else; mended, nine tenths
    of the pixels are right. For the largest shift it takes that the wall is known to be out of reach."""
    color, depth = picture()
    if shift == 2:
        depth = np.where(depth > 0.7, np.inf, depth)
    found = thin_mask(color, depth, np.roll(THREAD, shift, axis=1), np.ones_like(THREAD))
    assert (found & THREAD).sum() > 0.9 * THREAD.sum()
    assert (found & ~THREAD).sum() < 0.1 * THREAD.sum()


def test_a_hole_is_filled_and_a_good_mask_stays() -> None:
    """A lost blob at the end grows back."""
    color, depth = picture(1)
    holed = THREAD & (V < 42)
    found = thin_mask(color, depth, holed, np.ones_like(THREAD))
    assert (found & THREAD).sum() > 0.95 * THREAD.sum()
    whole = thin_mask(color, depth, THREAD, np.ones_like(THREAD))
    assert (whole ^ THREAD).sum() < 0.05 * THREAD.sum()


def test_other_things_are_left_alone() -> None:
    """Pixels that something else claims do not become the target's."""
    color, depth = picture(2)
    found = thin_mask(color, depth, THREAD & (V < 30), V < 30)
    assert not (found & (V >= 30)).any()


def test_without_depth_the_mask_is_believed_and_an_empty_one_stays_empty() -> None:
    """Nothing measured behind: no evidence against the mask. Nothing measured at all: no target."""
    color, depth = picture(3)
    only = np.where(THREAD, depth, np.nan)
    assert (thin_mask(color, only, THREAD, np.ones_like(THREAD)) & THREAD).sum() == THREAD.sum()
    nothing = np.full_like(depth, np.nan)
    assert not thin_mask(color, nothing, THREAD, np.ones_like(THREAD)).any()
    assert not thin_mask(color, depth, np.zeros_like(THREAD), np.ones_like(THREAD)).any()


def test_refuses_images_that_do_not_fit() -> None:
    color, depth = picture()
    with pytest.raises(InputError):
        thin_mask(color, depth[:-1], THREAD, THREAD)
    with pytest.raises(InputError):
        thin_mask(color, depth, THREAD.astype(float), THREAD)
