"""The Earth Mover's Distance: value, gradient, thinning, refusals."""

import itertools

import numpy as np
import pytest
import torch

from samrl_core.common.errors import InputError
from samrl_core.model.real2sim.emd import earth_movers, earth_movers_distance, farthest_points


def test_value_equals_search_over_all_matchings() -> None:
    """Against brute force over the 720 matchings of six points."""
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(6, 3)), rng.normal(size=(6, 3))
    best = min(
        np.mean([np.linalg.norm(a[i] - b[j]) for i, j in enumerate(order)])
        for order in itertools.permutations(range(6))
    )
    assert earth_movers(a, b).value == pytest.approx(best, abs=1e-12)


def test_moved_cloud_is_as_far_as_it_moved() -> None:
    """A rigid move by d costs |d| and the gradients of all points sum to its direction."""
    rng = np.random.default_rng(1)
    a = rng.uniform(-0.05, 0.05, size=(300, 3))
    move = np.array([0.003, -0.004, 0.0])
    result = earth_movers(a + move, a)
    assert result.value == pytest.approx(0.005, abs=1e-9)
    np.testing.assert_allclose(result.gradient.sum(axis=0), move / 0.005, atol=1e-9)
    assert result.matched.shape == (256, 2)


def test_gradient_against_central_differences_in_torch() -> None:
    """Both clouds, with unequal sizes: the larger one is thinned."""
    rng = np.random.default_rng(2)
    a = torch.tensor(rng.normal(size=(9, 3)), requires_grad=True)
    b = torch.tensor(rng.normal(size=(12, 3)), requires_grad=True)
    value = earth_movers_distance(a, b)
    grad_a, grad_b = torch.autograd.grad(value, (a, b))
    for cloud, gradient in ((a, grad_a), (b, grad_b)):
        numeric = np.zeros(cloud.shape)
        for i in np.ndindex(*cloud.shape):
            ends = []
            for h in (1e-6, -1e-6):
                moved = cloud.detach().clone()
                moved[i] += h
                pair = (moved, b.detach()) if cloud is a else (a.detach(), moved)
                ends.append(float(earth_movers_distance(*pair)))
            numeric[i] = (ends[0] - ends[1]) / 2e-6
        np.testing.assert_allclose(gradient.numpy(), numeric, atol=1e-6)


def test_thinning_covers_the_cloud_and_repeats() -> None:
    """Every point has a chosen one near by, and two calls agree."""
    points = np.random.default_rng(3).uniform(size=(2000, 3)) * [0.12, 0.12, 0.0]
    chosen = farthest_points(points, 256)
    assert len(set(chosen.tolist())) == 256
    gap = np.linalg.norm(points[:, None] - points[chosen][None], axis=-1).min(axis=1).max()
    assert gap < 0.01
    np.testing.assert_array_equal(chosen, farthest_points(points, 256))


@pytest.mark.parametrize(
    "bad", [np.zeros((0, 3)), np.zeros((4, 2)), np.full((4, 3), np.nan), np.zeros(3)], ids=repr
)
def test_refuses_bad_clouds(bad: np.ndarray) -> None:
    """Empty, misshapen or non-finite clouds are refused on either side."""
    good = np.zeros((4, 3))
    with pytest.raises(InputError):
        earth_movers(bad, good)
    with pytest.raises(InputError):
        earth_movers(good, bad)
