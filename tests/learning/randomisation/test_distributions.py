"""Distributions against what they draw, and against integrals by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from samrl_core.common.errors import InputError
from samrl_core.learning.randomisation.distributions import (
    BoundedNormal,
    Independent,
    Mixture,
    ParameterDistribution,
    UniformBox,
)
from samrl_core.learning.randomisation.space import Dimension, Space

SPACE = Space((Dimension("a/x", "m", 0.1, 0.0, 0.4), Dimension("b/y", "-", 0.0, -1.0, 2.0)))
NORMAL = BoundedNormal(SPACE, np.array([0.6, -1.0]), np.array([[0.3, 0.1], [0.1, 0.5]]))
BOX = UniformBox(SPACE, np.array([0.1, -0.5]), np.array([0.2, 1.5]))
MIXTURE = Mixture((UniformBox.whole(SPACE), BOX), np.array([0.7, 0.3]))
EVERY: dict[str, ParameterDistribution] = {
    "box": BOX,
    "bounded_normal": NORMAL,
    "mixture": MIXTURE,
    "independent": Independent(
        (
            UniformBox.whole(SPACE.part([0])),
            BoundedNormal(SPACE.part([1]), np.array([0.5]), np.array([[0.2]])),
        )
    ),
}


@pytest.mark.parametrize("name", sorted(EVERY))
def test_draws_are_seeded_inside_and_as_dense_as_said(name: str) -> None:
    one = EVERY[name]
    points = one.sample(np.random.default_rng(1), 4000)
    np.testing.assert_array_equal(points, one.sample(np.random.default_rng(1), 4000))
    assert not np.array_equal(points, one.sample(np.random.default_rng(2), 4000))
    assert points.shape == (4000, 2)
    assert ((points >= SPACE.lower) & (points <= SPACE.upper)).all()
    logs = one.log_density(points)
    assert np.isfinite(logs).all()
    # Entropy is the mean of -log density; the standard error is that of 4000 samples.
    assert abs(-logs.mean() - one.entropy()) < 4.0 * logs.std() / np.sqrt(4000) + 0.02
    outside = np.array([[0.5, 0.0], [0.1, 2.5], [-0.1, 0.0]])
    assert np.isneginf(one.log_density(outside)).all()
    assert one.record()["kind"] == name
    # The density is one: its mean over the whole box times the box's size.
    spread = UniformBox.whole(SPACE).sample(np.random.default_rng(3), 40_000)
    assert abs(np.exp(one.log_density(spread)).mean() * np.prod(SPACE.upper - SPACE.lower) - 1.0) < 0.06


def test_a_bounded_normal_of_one_dimension_by_quadrature() -> None:
    one = BoundedNormal(SPACE.part([0]), np.array([0.8]), np.array([[0.25]]))

    def density(x: float) -> float:
        return float(np.exp(one.log_density(np.array([[x]]))[0]))

    assert quad(density, 0.0, 0.4, epsabs=1e-10)[0] == pytest.approx(1.0, abs=1e-7)
    entropy = quad(lambda x: -density(x) * np.log(max(density(x), 1e-300)), 1e-12, 0.4 - 1e-12)[0]
    assert one.entropy() == pytest.approx(entropy, abs=1e-6)
    assert quad(density, 0.0, float(one.median[0]))[0] == pytest.approx(0.5, abs=1e-7)


def test_the_whole_bounded_normal_is_the_box() -> None:
    whole = BoundedNormal.whole(SPACE)
    points = UniformBox.whole(SPACE).sample(np.random.default_rng(0), 50)
    np.testing.assert_allclose(
        whole.log_density(points), UniformBox.whole(SPACE).log_density(points), atol=1e-9
    )
    assert whole.entropy() == pytest.approx(UniformBox.whole(SPACE).entropy())


def test_relative_entropy_is_that_of_the_draws() -> None:
    """In the space's own units, though it is worked out for z."""
    other = BoundedNormal.whole(SPACE)
    points = NORMAL.sample(np.random.default_rng(5), 20_000)
    ratio = NORMAL.log_density(points) - other.log_density(points)
    error = ratio.std() / np.sqrt(len(ratio))
    assert NORMAL.divergence_from(other) == pytest.approx(ratio.mean(), abs=4 * error)
    assert NORMAL.divergence_from(NORMAL) == pytest.approx(0.0, abs=1e-12)


def test_what_is_no_distribution_is_refused() -> None:
    for broken, words in (
        (lambda: Dimension("a", "m", 0.0, 1.0, 1.0), "bounds"),
        (lambda: Dimension("a", "m", 3.0, 0.0, 1.0), "nominally"),
        (lambda: Space(()), "different names"),
        (lambda: Space((SPACE.dimensions[0],) * 2), "different names"),
        (lambda: UniformBox(SPACE, SPACE.lower - 0.1, SPACE.upper), "a/x"),
        (lambda: UniformBox(SPACE, SPACE.upper, SPACE.upper), "a/x"),
        (lambda: BoundedNormal(SPACE, np.zeros(2), np.diag([1.0, -1.0])), "not definite"),
        (lambda: BoundedNormal(SPACE, np.zeros(3), np.eye(3)), "2 dimensions"),
        (lambda: Mixture((BOX,), np.array([0.5])), "sum to 1"),
        (lambda: BOX.log_density(np.zeros((1, 3))), "must be"),
        (lambda: BOX.log_density(np.array([[np.nan, 0.0]])), "finite"),
    ):
        with pytest.raises(InputError, match=words):
            broken()
