"""Uniform, ADR and SimOpt on problems whose answers are known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_core.learning.randomisation.adr import Adr, AdrSettings
from samrl_core.learning.randomisation.distributions import BoundedNormal, UniformBox
from samrl_core.learning.randomisation.simopt import SimOpt, SimOptSettings, reps_weights, within_bound
from samrl_core.learning.randomisation.space import Dimension, Space
from samrl_core.learning.randomisation.strategy import Question, QuestionResult, Strategy, Uniform

SPACE = Space((Dimension("a/x", "m", 0.1, 0.0, 0.4), Dimension("b/y", "-", 0.0, -1.0, 2.0)))


def rounds(strategy: Any, result: Any, count: int, seed: int = 0) -> list[Any]:
    """The strategy before and after each of so many questions, answered by result(points) -> (N,)."""
    rng, found = np.random.default_rng(seed), [strategy]
    for _ in range(count):
        question = found[-1].ask(rng)
        found.append(found[-1].update(QuestionResult(question, result(question.points))))
    return found


def test_uniform_is_the_whole_space_and_asks_nothing() -> None:
    strategy: Strategy = Uniform(SPACE)
    points = strategy.distribution.sample(np.random.default_rng(0), 500)
    assert (points >= SPACE.lower).all() and (points <= SPACE.upper).all()
    share = (points - SPACE.lower) / (SPACE.upper - SPACE.lower)
    np.testing.assert_allclose(np.quantile(share, [0.1, 0.5, 0.9], axis=0), [[0.1] * 2, [0.5] * 2, [0.9] * 2],
                               atol=0.07)  # fmt: skip
    question = strategy.ask(np.random.default_rng(0))
    assert len(question) == 0
    after = strategy.update(QuestionResult(question, np.zeros(0)))
    assert after.distribution.entropy() == strategy.distribution.entropy()


ADR = AdrSettings(buffer=4, episodes=64, step=0.1, begin=0.1)


def test_adr_grows_to_the_bounds_where_all_succeeds() -> None:
    found = rounds(Adr.begin(SPACE, ADR), lambda points: np.ones(len(points)), 12)
    entropies = [one.distribution.entropy() for one in found]
    assert entropies[0] == pytest.approx(np.log(0.1 * (SPACE.upper - SPACE.lower)).sum())
    assert all(a < b for a, b in zip(entropies[:4], entropies[1:5], strict=True))
    np.testing.assert_allclose(found[-1].distribution.lower, SPACE.lower)
    np.testing.assert_allclose(found[-1].distribution.upper, SPACE.upper)


def test_adr_shrinks_to_where_it_began_where_nothing_succeeds() -> None:
    begun = Adr.begin(SPACE, ADR)
    wide = replace(begun, distribution=UniformBox.whole(SPACE))
    found = rounds(wide, lambda points: np.zeros(len(points)), 12)
    entropies = [one.distribution.entropy() for one in found]
    assert all(a > b for a, b in zip(entropies[:4], entropies[1:5], strict=True))
    np.testing.assert_allclose(found[-1].distribution.lower, begun.distribution.lower)
    np.testing.assert_allclose(found[-1].distribution.upper, begun.distribution.upper)


def test_adr_finds_where_an_actor_still_succeeds() -> None:
    """It succeeds below x = 0.25 whatever y is: the boundary of x stays within a step of that.

    Where x is sampled from a little beyond, some episodes at y's boundaries fail for x: y lags, but grows.
    """
    found = rounds(Adr.begin(SPACE, ADR), lambda points: (points[:, 0] <= 0.25).astype(float), 30)
    box = found[-1].distribution
    assert box.lower[0] == pytest.approx(0.0) and 0.21 <= box.upper[0] <= 0.30
    assert box.upper[1] - box.lower[1] >= 0.8 * 3.0


def test_adr_between_its_thresholds_stays_and_forgets() -> None:
    """Mean success of 0.65 moves nothing; the buffer is emptied all the same."""
    begun = Adr.begin(SPACE, replace(ADR, buffer=2))
    point = begun.distribution.sample(np.random.default_rng(0), 2)
    point[:, 1] = begun.distribution.upper[1]
    question = Question(point, np.array([3, 3]))
    after = begun.update(QuestionResult(question, np.array([0.5, 0.8])))
    assert after.distribution.entropy() == begun.distribution.entropy() and after.tried[3] == ()
    one = begun.update(QuestionResult(Question(point[:1], np.array([3])), np.array([1.0])))
    assert one.tried[3] == (1.0,)
    two = one.update(QuestionResult(Question(point[:1], np.array([3])), np.array([1.0])))
    assert two.distribution.upper[1] == pytest.approx(begun.distribution.upper[1] + 0.3)
    # What was tried at the old boundary says nothing of the new one.
    stale = two.update(QuestionResult(question, np.array([0.0, 0.0])))
    assert stale.distribution.upper[1] == two.distribution.upper[1] and stale.tried[3] == ()


def test_adr_asks_at_boundaries_and_is_seeded() -> None:
    begun = Adr.begin(SPACE, ADR)
    question, again = (begun.ask(np.random.default_rng(4)) for _ in range(2))
    np.testing.assert_array_equal(question.points, again.points)
    edges = np.concatenate([begun.distribution.lower, begun.distribution.upper])
    np.testing.assert_array_equal(question.points[np.arange(64), question.label % 2], edges[question.label])
    assert set(question.label) == {0, 1, 2, 3}
    with pytest.raises(InputError, match="success"):
        begun.update(QuestionResult(question, np.full(64, 2.0)))


TRUE = np.array([0.31, 1.4])


def quadratic(points: np.ndarray) -> np.ndarray:
    """Discrepancy of a model whose true parameters are `TRUE`; the two are seen equally well."""
    return (((points - TRUE) / (SPACE.upper - SPACE.lower)) ** 2).sum(axis=1)


@pytest.mark.parametrize("seed", range(5))
def test_simopt_recovers_a_known_parameter_in_three_iterations(seed: int) -> None:
    found = rounds(SimOpt.begin(SPACE, settings=SimOptSettings(draws=128)), quadratic, 3, seed)
    last = found[-1]
    error = np.abs(last.fitted.median - TRUE) / (SPACE.upper - SPACE.lower)
    assert (error < 0.06).all(), "a sixteenth of the bounds' width"
    mean_cost = [quadratic(one.distribution.sample(np.random.default_rng(9), 500)).mean() for one in found]
    assert all(a > b for a, b in zip(mean_cost[:-1], mean_cost[1:], strict=True))
    assert mean_cost[-1] < 0.1 * mean_cost[0]
    assert len(last.steps) == 3 and all(0.0 < kl <= 1.0 + 1e-9 for kl in last.steps)
    for before, after, kl in zip(found[:-1], found[1:], last.steps, strict=True):
        assert after.fitted.divergence_from(before.fitted) == pytest.approx(kl)
    assert len(last.ask(np.random.default_rng(0))) == 0, "three iterations are all"


@pytest.mark.parametrize("bound", [0.05, 0.3, 2.0])
@pytest.mark.parametrize("draws", [4, 20])
def test_no_step_of_simopt_goes_beyond_its_bound(bound: float, draws: int) -> None:
    """With few samples too, where the fit by itself would be degenerate."""
    settings = SimOptSettings(iterations=5, bound=bound, draws=draws)
    for one in rounds(SimOpt.begin(SPACE, settings=settings), quadratic, 5, 1)[1:]:
        assert one.steps[-1] <= bound + 1e-9


def test_simopt_leaves_alone_what_no_discrepancy_speaks_of() -> None:
    others = Space((Dimension("look/x", "-", 0.0, -1.0, 1.0),))

    def cost(points: np.ndarray) -> np.ndarray:
        return quadratic(points[:, 1:])

    last = rounds(SimOpt.begin(SPACE, others, SimOptSettings(draws=128)), cost, 3)[-1]
    assert last.distribution.space.names == ("look/x", "a/x", "b/y")
    assert (np.abs(last.fitted.median - TRUE) / (SPACE.upper - SPACE.lower) < 0.06).all()
    looks = last.distribution.sample(np.random.default_rng(0), 2000)[:, 0]
    assert abs(looks.mean()) < 0.06 and looks.std() == pytest.approx(1 / np.sqrt(3), abs=0.03)


def test_simopt_without_differences_stays_about_where_it_is() -> None:
    last = rounds(SimOpt.begin(SPACE, settings=SimOptSettings(draws=400)), lambda p: np.ones(len(p)), 1)[-1]
    assert last.steps[0] < 0.02


def test_weights_are_those_of_the_bound() -> None:
    cost = np.random.default_rng(0).uniform(3.0, 8.0, 200)
    for bound in (0.1, 0.7, 1.5):
        weights = reps_weights(cost, bound)
        assert weights.sum() == pytest.approx(1.0)
        assert (weights * np.log(weights * 200)).sum() == pytest.approx(bound, abs=0.01)
        assert (np.diff(weights[np.argsort(cost)]) <= 0).all()
    np.testing.assert_allclose(reps_weights(np.full(5, 2.0), 1.0), 0.2)


def test_a_fit_within_the_bound_is_taken_whole() -> None:
    last = BoundedNormal.whole(SPACE)
    z = np.random.default_rng(0).standard_normal((500, 2))
    found = within_bound(last, z, np.full(500, 1 / 500), 1.0)
    np.testing.assert_allclose(found.mean, z.mean(axis=0))
    np.testing.assert_allclose(found.covariance, np.cov(z.T, bias=True))


def test_settings_outside_their_meaning_are_refused() -> None:
    for broken in (
        lambda: AdrSettings(low=0.9, high=0.8),
        lambda: AdrSettings(step=0.0),
        lambda: AdrSettings(buffer=0),
        lambda: SimOptSettings(bound=0.0),
        lambda: SimOptSettings(draws=2),
        lambda: QuestionResult(Question(np.zeros((2, 1)), np.zeros(2, dtype=np.int64)), np.zeros(1)),
        lambda: QuestionResult(Question(np.zeros((1, 1)), np.zeros(1, dtype=np.int64)), np.array([np.nan])),
    ):
        with pytest.raises(InputError):
            broken()
