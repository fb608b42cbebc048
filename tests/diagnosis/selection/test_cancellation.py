"""Members that undo each other are no finding, and a form inside its bounds goes first in a set too."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from samrl_core.diagnosis.effects.friction.viscous_friction import EFFECT as VISCOUS
from samrl_core.diagnosis.kinds.arms import arm_trials
from samrl_core.diagnosis.residuals.likelihood import Likelihood, Regressors
from samrl_core.diagnosis.selection.cancellation import undo_each_other
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, Hypothesis
from samrl_core.diagnosis.selection.search import find_extensions, swap_members
from tests.diagnosis.controllers.kinds import VELOCITY_DRIVE
from tests.diagnosis.controllers.machines import Differs, worlds

SIZE = 400.0  # of an effect, in deviations of the noise over all samples


def stand_in(family: str, shape: dict[str, float] | None = None, form: str = "") -> Hypothesis:
    """A family of one amplitude; its hidden shape `s` is searched between 1 and 10."""
    effect = SimpleNamespace(family=family, parameters=(), renamed_shapes=(), prior_cost=0.0)
    made = SimpleNamespace(
        name=form,
        place=SimpleNamespace(name="joint:a"),
        refine={"s": (1.0, 10.0)},
        may_vanish=(),
        is_admissible=lambda *_: True,
    )
    nothing = np.zeros(0)
    empty = Regressors({}, np.zeros((0, 0)))
    return Hypothesis(
        cast(Any, effect), cast(Any, made), shape or {}, empty, nothing, nothing, nothing, nothing
    )


class Bench:
    """A drive's recording whose residual is a sum of two known columns that are alike to a third."""

    def __init__(self, first: float, second: float) -> None:
        """Sizes of both, relative to `SIZE`."""
        (recordings,) = worlds(VELOCITY_DRIVE, [Differs()], 3, 2.0)
        trial = arm_trials(recordings[:1], [])[0][0]
        (place,) = VISCOUS.places(trial)
        ((key, rows),) = VISCOUS.forms(trial, place)[0].columns(trial, {}).items()
        channel, joint = key
        sigma = trial.sigma[channel][:, joint]
        speed = rows[0] / np.linalg.norm(rows[0] / sigma)
        other = np.random.default_rng(1).normal(size=len(speed)) * sigma
        other /= np.linalg.norm(other / sigma)
        columns = (SIZE * speed, SIZE * (speed + 0.25 * other))
        trial.equations.residual[channel][:, joint] = first * columns[0] + second * columns[1]
        self.evidence = Evidence(Likelihood([trial]), 2.0)
        names = ("first", "second")
        self.first, self.second = (self._made(n, {key: c[None]}) for n, c in zip(names, columns, strict=True))

    def _made(self, family: str, columns: dict[tuple[str, int], np.ndarray]) -> Hypothesis:
        likelihood, bare = self.evidence.likelihood, stand_in(family)
        there = likelihood.regressors([columns])
        gram, moment = likelihood.plain_gram(there, there), likelihood.plain_moment(there)
        return Hypothesis(bare.effect, bare.form, {}, there, np.zeros(1), np.ones(1), gram, moment)


@pytest.mark.parametrize(
    ("first", "second", "undone"), [(1.0, -1.0, True), (1.0, 1.0, False), (1.0, -0.4, False)]
)
def test_a_further_effect_that_undoes_the_first_is_none(first: float, second: float, undone: bool) -> None:
    bench = Bench(first, second)
    both = bench.evidence.fit([bench.first, bench.second])
    alone = bench.evidence.fit([bench.first])
    assert both.log_evidence > alone.log_evidence + 100.0  # evidence would take it in all three
    assert undo_each_other(bench.evidence, both) is undone
    assert bool(find_extensions(bench.evidence, [bench.second], alone)) is not undone


def test_members_are_not_exchanged_for_one_that_the_other_undoes() -> None:
    bench = Bench(1.0, -1.0)
    key = next(iter(bench.first.regressors.blocks))
    rng = np.random.default_rng(2)
    noise = {key[1:]: 0.01 * SIZE * rng.normal(size=bench.first.regressors.blocks[key].shape)}
    weak = bench._made("weak", noise)
    chosen = bench.evidence.fit([weak, bench.second])
    assert bench.evidence.fit([bench.first, bench.second]).log_evidence > chosen.log_evidence
    kept = swap_members(bench.evidence, [weak, bench.first, bench.second], chosen)
    assert [h.effect.family for h in kept.hypotheses] == ["weak", "second"]


class Stated:
    """Evidence of sets by their first member's form."""

    likelihood = SimpleNamespace(exact=True)

    def __init__(self, worth: dict[str, float]) -> None:
        """Log evidence [nat] of each form."""
        self.worth = worth

    def fit(self, hypotheses: Sequence[Hypothesis], at_borders: bool = False) -> Fit:
        """As stated."""
        nothing = tuple(np.zeros(0) for _ in hypotheses)
        return Fit(tuple(hypotheses), nothing, np.zeros((0, 0)), self.worth[hypotheses[0].form.name])

    def refine(self, fit: Fit, index: int, evaluations: int = 30, at_borders: bool = False) -> Fit:
        """Nothing better is found."""
        return fit


@pytest.mark.parametrize(
    ("worth", "taken"),
    [
        ({"before": 100.0, "edge": 200.0, "inside": 185.0}, "inside"),  # nearly as good, within its bounds
        ({"before": 100.0, "edge": 200.0, "inside": 150.0}, "edge"),  # much less: the edge stays
        ({"before": 190.0, "edge": 200.0, "inside": 185.0}, "edge"),  # less than what stood there
    ],
)
def test_an_exchanged_member_takes_the_form_inside_its_bounds(worth: dict[str, float], taken: str) -> None:
    before = stand_in("other", {"s": 3.0}, "before")
    edge, inside = stand_in("first", {"s": 10.0}, "edge"), stand_in("first", {"s": 3.0}, "inside")
    evidence = cast(Evidence, Stated(worth))
    chosen = evidence.fit([before, stand_in("last", {"s": 3.0}, "before")])
    found = swap_members(evidence, [edge, inside], chosen)
    assert found.hypotheses[0].form.name == taken
