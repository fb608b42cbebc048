"""Twins are told apart by where each recording lies between them, and not by a share of what both explain."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.hypothesis import Fit
from samrl_core.diagnosis.selection.selection import Selection
from samrl_core.diagnosis.verdict.confidence import probabilities
from samrl_core.diagnosis.verdict.encompassing import find_told_apart, lies_at_first, why_tied
from tests.diagnosis.selection.bench import SIZE, Bench

K = 2.0  # samples that count as one
APART = 0.03  # of what twins explain, by which they differ: 36 of 40,000 nat


@cache
def parts() -> tuple[Bench, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A bench; what the first explains of the fitted recording, and the way to the second; so unseen."""
    bench = Bench(0.0, 0.0)
    base, way, there, way_there = (bench.white(t) for t in 2 * [bench.fitted] + 2 * [bench.unseen])
    return bench, base, APART * way, there, APART * way_there


def twins(place: float, unseen: float) -> tuple[Likelihood, Likelihood, Selection]:
    """Two near twins: the fitted recording holds the first at `place` 0, the second at 1."""
    bench, base, way, there, way_there = parts()
    bench.set_residual(bench.fitted, base + place * way)
    bench.set_residual(bench.unseen, there + unseen * way_there)
    bench.evidence.likelihood = Likelihood([bench.fitted])
    fits = [
        bench.evidence.fit([bench.made("first", base, there)]),
        bench.evidence.fit([bench.made("second", base + way, there + way_there)]),
    ]
    fits.sort(key=lambda f: -f.log_evidence)
    excess = 0.5 * SIZE**2 / K
    chosen = Selection(fits[0], tuple(fits), tuple(fits[1:]), 12.0, excess, 0.0, excess, 0.0, K)
    return bench.evidence.likelihood, Likelihood([bench.unseen]), chosen


def odds(fitted: Likelihood, held_out: Likelihood, selection: Selection) -> float:
    """Probability of the chosen one of two."""
    assert selection.chosen is not None
    told = [1] if find_told_apart(fitted, held_out, selection) else []
    return float(probabilities([selection.chosen, *selection.rivals], selection.remaining, told=told)[0])


def test_a_twin_that_each_recording_denies_is_no_tie() -> None:
    fitted, held_out, selection = twins(0.0, 0.0)
    lead = selection.rivals[0].log_evidence
    assert selection.chosen is not None and 20.0 < selection.chosen.log_evidence - lead < 0.0025 * lead
    assert probabilities([selection.chosen, *selection.rivals])[0] < 0.6  # a share of the whole hides it
    assert odds(fitted, held_out, selection) > 0.999


@pytest.mark.parametrize(
    ("place", "unseen"),
    [(0.35, 0.35), (0.0, 0.5), (0.0, 1.0), (-0.6, -0.6)],
    ids=["between both", "between in the unseen one", "the other in the unseen one", "beyond both"],
)
def test_twins_of_which_neither_is_the_thing_itself_stay_tied(place: float, unseen: float) -> None:
    fitted, held_out, selection = twins(place, unseen)
    assert find_told_apart(fitted, held_out, selection) == []


def test_the_truth_lies_at_one_of_two_only() -> None:
    fitted, _, selection = twins(0.0, 0.0)
    assert selection.chosen is not None
    pair = [selection.chosen, selection.rivals[0]]
    assert lies_at_first(fitted, *pair, K)
    assert not lies_at_first(fitted, *pair[::-1], K)


def test_recordings_that_tell_little_tell_nothing() -> None:
    """By so much that noise could have been it, twins stay tied although the recording lies at one."""
    fitted, _, selection = twins(0.0, 0.0)
    assert selection.chosen is not None
    assert not lies_at_first(fitted, selection.chosen, selection.rivals[0], K * 100.0)


def test_one_recording_between_both_denies_that_all_lie_at_one() -> None:
    """Together they lie near the first, and one of them does not."""
    bench, base, way, there, way_there = parts()

    def fits(place: float, other: float) -> tuple[Likelihood, Fit, Fit]:
        bench.set_residual(bench.fitted, base + place * way)
        bench.set_residual(bench.unseen, there + other * way_there)
        bench.evidence.likelihood = Likelihood([bench.fitted, bench.unseen])
        both = (bench.made("first", base, there), bench.made("second", base + way, there + way_there))
        one, two = (bench.evidence.fit([h]) for h in both)
        return bench.evidence.likelihood, one, two

    assert lies_at_first(*fits(0.0, 0.0), K)
    likelihood, one, two = fits(-0.55, 0.65)
    moved = np.array([-0.55, 0.65])
    assert abs(np.mean(moved)) < 0.2  # together they would pass
    assert not lies_at_first(likelihood, one, two, K)


def test_a_tie_says_why() -> None:
    """How far the recordings lie from either, or that both foretell the same."""
    assert "lie at 0.3" in why_tied(*twins(0.35, 0.35), rival="second@joint:a")
    fitted, held_out, selection = twins(0.0, 0.0)
    alike = replace(selection, correlation_time=100.0)
    assert "foretell all of these recordings alike" in why_tied(fitted, held_out, alike, "second@joint:a")
    assert why_tied(fitted, held_out, alike, "none@joint:a") == ""
