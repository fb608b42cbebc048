"""What a further member must show, and that a form inside its bounds goes first in a set too."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.cancellation import undo_each_other
from samrl_core.diagnosis.selection.further_effect import is_worth
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, Hypothesis
from samrl_core.diagnosis.selection.on_held_out import held_out_gains, held_out_remainder
from samrl_core.diagnosis.selection.search import find_extensions, swap_members
from samrl_core.diagnosis.selection.settings import SelectionSettings
from tests.diagnosis.selection.bench import SIZE, Bench, stand_in


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


@pytest.mark.parametrize(("beside", "undone"), [(0.05, True), (0.3, False)])
def test_of_exact_effects_only_two_that_do_the_same_undo_each_other(
    beside: float, undone: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A camera 4 ms late and its only arm's clock 3 ms ahead: both were named for 1 ms of rounded stamps."""
    bench = Bench(1.0, -0.9)
    bench.columns = (bench.columns[0], bench.columns[0] + beside * bench.white(bench.fitted))
    bench.set_residual(bench.fitted, bench.columns[0] - 0.9 * bench.columns[1])
    bench.evidence = Evidence(Likelihood([bench.fitted]), 2.0)
    monkeypatch.setattr(Likelihood, "exact", True)
    pair = [bench.made("late", bench.columns[0]), bench.made("ahead", bench.columns[1])]
    both = Fit(tuple(pair), (np.ones(1), np.full(1, -0.9)), np.zeros((2, 2)), 100.0)
    assert undo_each_other(bench.evidence, both) is undone


def test_members_are_not_exchanged_for_one_that_the_other_undoes() -> None:
    bench = Bench(1.0, -1.0)
    weak = bench.made("weak", 0.3 * bench.white(bench.fitted))
    chosen = bench.evidence.fit([weak, bench.second])
    assert bench.evidence.fit([bench.first, bench.second]).log_evidence > chosen.log_evidence
    kept = swap_members(bench.evidence, [weak, bench.first, bench.second], chosen)
    assert [h.effect.family for h in kept.hypotheses] == ["weak", "second"]


@pytest.mark.parametrize(("second", "helps"), [(1.04, False), (1.09, True)])
def test_mending_what_the_first_spoiled_is_no_help(second: float, helps: bool) -> None:
    bench = Bench(1.0, -0.95)
    held_out = bench.held_out(-0.03, second)
    narrow, wide = bench.evidence.fit([bench.first]), bench.evidence.fit([bench.first, bench.second])
    (lost, _), (both, _) = (held_out_gains(held_out, f, 2.0) for f in (narrow, wide))
    assert lost < both and lost < 0.0  # unseen data fit less badly with both
    assert (both > 0.0) is helps
    left = held_out_remainder(held_out, narrow)
    assert is_worth(bench.evidence, held_out, narrow, left, wide, SelectionSettings()) is helps


@pytest.mark.parametrize("there", [0.0, 1.0])
def test_a_further_effect_that_unseen_recordings_do_not_show_is_none(there: float) -> None:
    """Where these hold nothing beyond noise, nothing is left to remove; what they say against it counts."""
    bench = Bench(1.0, 0.0)
    scale, weak = bench.fitted.sigma["dynamics"][:, 0] ** 2, bench.white(bench.fitted)
    weak -= bench.columns[0] * np.sum(weak * bench.columns[0] / scale) / SIZE**2
    bench.set_residual(bench.fitted, bench.columns[0] + weak)
    bench.evidence = Evidence(Likelihood([bench.fitted]), 2.0)
    base, unseen = bench.white(bench.unseen), 0.02 * bench.white(bench.unseen)
    bench.set_residual(bench.unseen, base + there * unseen)
    held_out = Likelihood([bench.unseen])
    first, second = bench.made("first", bench.columns[0], base), bench.made("second", weak, unseen)
    narrow, wide = bench.evidence.fit([first]), bench.evidence.fit([first, second])
    left = held_out_remainder(held_out, narrow)
    assert held_out.deficit(left, 2.0) == pytest.approx(0.0, abs=1.0)
    assert is_worth(bench.evidence, held_out, narrow, left, wide, SelectionSettings()) is (there > 0.0)


class Stated:
    """Evidence of sets by their first member's form."""

    likelihood = SimpleNamespace(exact=True, combined=lambda *_: None, plain_gram=lambda *_: np.ones(1))

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
