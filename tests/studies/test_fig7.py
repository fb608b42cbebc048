"""Fig. 7: gradients and covered patches of functions whose pixels are known, and one episode as a whole."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from samrl_core.studies.experiment import Options
from samrl_core.studies.paper import fig7
from samrl_core.studies.paper.saliency import SaliencySettings, cover_map, gradient_maps, within_patches
from samrl_core.studies.paper.view_maps import rank_correlation

SETTINGS = SaliencySettings(noise_samples=2, patch=8, stride=8)


def corner(image: torch.Tensor) -> torch.Tensor:
    """Looks at colour and X of one part of the image alone."""
    return 3.0 * image[:, 0, :8, 8:16].sum(dim=(1, 2)) - image[:, 3, :8, 8:16].sum(dim=(1, 2))


def test_slopes_lie_where_the_output_looks() -> None:
    images = [torch.ones(2, 6, 32, 32), torch.zeros(2, 6, 32, 32)]
    found = gradient_maps(images, [corner, corner], 0.0)
    expected = np.zeros((2, 32, 32))
    expected[:, :8, 8:16] = 4.0
    np.testing.assert_allclose(found, expected)
    blurred = gradient_maps(images, [corner, corner], 1.5)
    assert blurred.sum() == pytest.approx(expected.sum()) and blurred.max() < 4.0 + 1e-6


def test_covering_changes_what_the_output_looks_at() -> None:
    image = torch.ones(6, 32, 32)
    whole = corner(image[None])
    found = cover_map(image, lambda some: (corner(some) - whole).abs(), SETTINGS, 5)
    expected = np.zeros((4, 4))
    expected[0, 1] = 2.0 * 64
    np.testing.assert_allclose(found, expected)
    assert torch.equal(image, torch.ones(6, 32, 32))
    gradients = gradient_maps([image[None]], [corner], 0.0)
    assert rank_correlation(within_patches(gradients, SETTINGS).ravel(), found.ravel()) == pytest.approx(1.0)


@pytest.mark.thorough
def test_one_episode_is_run_and_summed_up(tmp_path: Path) -> None:
    settings = SaliencySettings(noise_samples=1, patch=32, stride=32)
    options = Options(tmp_path, ("peg_insertion",), count=1, workers=1)
    summary = fig7.run(options, print, views=1, settings=settings)
    for network in ("actor", "q"):
        found = summary["tasks"]["peg_insertion"][network]
        assert found["target_energy_over_area"]["views"] == 3
        target, objects = (found[f"{mask}_energy"]["median"] for mask in ("target", "objects"))
        assert 0.0 < target < objects < 1.0
        assert -1.0 <= found["covering_agrees"]["median"] <= 1.0
    # The actor that is shipped looks at the block more than at anything else of that size.
    assert summary["tasks"]["peg_insertion"]["actor"]["target_energy_over_area"]["median"] > 1.5
    assert (tmp_path / "fig7.png").stat().st_size > 20_000
