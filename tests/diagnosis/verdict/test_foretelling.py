"""What is named must foretell recordings that were never fitted: against nobody, and against its rivals."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import pytest

from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.result import HeldOutGap
from samrl_core.diagnosis.selection.hypothesis import Fit
from samrl_core.diagnosis.selection.selection import Selection, without_member
from samrl_core.diagnosis.verdict.foretelling import find_as_foretelling, is_denied_there
from samrl_core.diagnosis.verdict.how_far import HowFar
from samrl_core.diagnosis.verdict.rules import VerdictSettings, decide
from tests.diagnosis.selection.bench import Bench

if TYPE_CHECKING:
    from samrl_core.diagnosis.result import NamedEffect

K = 2.0  # samples that count as one


def chosen_from(fits: list[Fit], rivals: tuple[Fit, ...] = ()) -> Selection:
    return Selection(
        fits[0], tuple(fits), rivals or tuple(fits[1:]), 12.0, 100.0, 1.0, 100.0, 1.0, K,
        held_out_gain=50.0, held_out_expected=50.0,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("extra_there", "as_well"), [(0.03, False), (-0.02, True)], ids=["shown", "not shown"]
)
def test_what_one_explains_beyond_another_must_be_foretold(extra_there: float, as_well: bool) -> None:
    """Both explain the fitted recording; the chosen one has an extra that the unseen one may show."""
    bench = Bench(0.0, 0.0)
    base, extra = bench.white(bench.fitted), 0.03 * bench.white(bench.fitted)
    bench.set_residual(bench.fitted, base + extra)
    bench.evidence.likelihood = Likelihood([bench.fitted])
    there, extra_unseen = bench.white(bench.unseen), 0.03 * bench.white(bench.unseen)
    bench.set_residual(bench.unseen, there + extra_there / 0.03 * extra_unseen)
    held_out = Likelihood([bench.unseen])
    finer = bench.evidence.fit([bench.made("finer", base + extra, there + extra_unseen)])
    plain = bench.evidence.fit([bench.made("plain", base, there)])
    assert finer.log_evidence > plain.log_evidence + 12.0
    found = find_as_foretelling(bench.evidence, held_out, chosen_from([finer, plain]))
    assert found == ([plain] if as_well else [])


def test_a_rival_that_foretells_nothing_is_denied() -> None:
    bench = Bench(1.0, 0.0)
    held_out = bench.held_out(1.0, 1.0)
    right = bench.evidence.fit([bench.first])
    wrong = bench.evidence.fit([bench.made("wrong", bench.columns[0], -bench.white(bench.unseen))])
    assert not is_denied_there(held_out, right, K)
    assert is_denied_there(held_out, wrong, K)


def test_a_set_that_loses_its_further_member_has_all_single_effects_as_rivals() -> None:
    """A gain was no rival beside a wrong inertia, and stayed none when the inertia was gone."""
    bench = Bench(1.0, 0.4)
    held_out = bench.held_out(1.0, 0.4)
    pair = bench.evidence.fit([bench.first, bench.second])
    third = bench.evidence.fit([bench.made("third", bench.columns[0] + bench.columns[1])])
    singles = [bench.evidence.fit([bench.first]), third]
    whole = replace(chosen_from([pair]), singles=tuple(singles), rivals=())
    fewer = without_member(bench.evidence.likelihood, held_out, whole, (1,))
    assert fewer.chosen is not None and len(fewer.chosen.hypotheses) == 1
    assert [f.hypotheses[0].effect.family for f in fewer.rivals] == ["third"]


@pytest.mark.parametrize(
    ("nominal", "shrink", "interval", "gains", "verdict"),
    [
        (0.49, -0.07, (-0.14, -0.005), 43.0, "none_of_mine"),  # little, but for sure
        (0.49, -0.07, (-0.14, -0.005), 900.0, "effect"),  # surer still is what was fitted; the gap is small
        (0.49, -0.03, (-0.09, 0.03), 43.0, "effect"),  # perhaps by chance
        (0.49, 0.3, (0.2, 0.4), 43.0, "effect"),
        (1.08, -0.004, (-0.008, -0.0001), 900.0, "effect"),  # less than anybody would notice
        (1.08, -0.004, (-0.008, -0.0001), 43.0, "none_of_mine"),
        (1.08, -0.07, (-0.14, -0.005), 900.0, "none_of_mine"),
    ],
)
def test_what_makes_the_held_out_gap_grow_for_sure_is_not_named(
    nominal: float, shrink: float, interval: tuple[float, float], gains: float, verdict: str
) -> None:
    """Gains 64 and 32 % off with a rotor inertia won 43 nat for a drive 9 % too strong.

    A forged backlash of 231,560 nat was refused, as the gap "grows by 0 %" with it.
    """
    effect = SimpleNamespace(limits_motion=False, by_chance=False)
    one = cast("Fit", SimpleNamespace(hypotheses=(SimpleNamespace(effect=effect),), log_evidence=gains))
    first = cast("NamedEffect", SimpleNamespace(name="a@joint:x", probability=1.0, gain=gains))
    gap = HeldOutGap("", "1", nominal, nominal * (1.0 - shrink), None, None, shrink, interval, None, (), ())
    selection = replace(chosen_from([one]), rivals=())
    outcome = decide(selection, [first], [], [], HowFar(gap, ()), VerdictSettings())
    assert outcome.verdict == verdict
    assert outcome.contradicted is (verdict == "none_of_mine")


@pytest.mark.parametrize(
    ("changes", "verdict"),
    [
        ({}, "no_gap"),
        ({"shrink": 0.2}, "effect"),  # seen in motion
        ({"there": 30.0}, "effect"),  # seen in residuals
        ({"gains": 400.0}, "effect"),  # there, and not again
        ({"by_chance": True}, "effect"),
        ({"width": 0.005, "won": 20.0}, "effect"),  # little motion, for sure
        ({"width": 0.005, "won": 20.0, "margin": -0.01}, "no_gap"),  # less than a rival's
        ({"width": 0.005, "won": 2.0}, "no_gap"),  # and nothing in residuals
        ({"won": 32.0}, "effect"),  # as much as foretold, and nothing in motion
        ({"won": 19.0}, "no_gap"),  # half of that, as noise in a regressor wins
        ({"won": 32.0, "shrink": -0.2}, "no_gap"),  # motion denies it
    ],
    ids=[
        "nowhere",
        "motion",
        "residual",
        "sure",
        "chance",
        "a little",
        "as a rival",
        "motion alone",
        "foretold",
        "half foretold",
        "denied",
    ],
)
def test_what_unseen_recordings_show_nowhere_is_no_effect(changes: dict, verdict: str) -> None:
    """A gantry with nothing wrong had 51 nat of a residual that was noise, and 1 % of the gap.

    The gantry's unseen recordings won 19 of 34 by it, and lost motion. Those of an arm whose encoder was off
    by 6 mrad won 32 of 39, and 4 % [3, 6]; those of a drive 12 % too strong 16.5 of 17.5 and no motion.
    """
    usual = {"shrink": 0.01, "there": 0.0, "gains": 51.0, "by_chance": False}
    given = {**usual, "width": 0.05, "won": 0.0, "margin": 0.02, **changes}
    effect = SimpleNamespace(limits_motion=False, by_chance=given["by_chance"])
    fit = SimpleNamespace(hypotheses=(SimpleNamespace(effect=effect),), log_evidence=given["gains"])
    first = cast("NamedEffect", SimpleNamespace(name="a@joint:x", probability=1.0, gain=given["gains"]))
    shrink = given["shrink"]
    interval = (shrink - given["width"], shrink + given["width"])
    margin = given["margin"]
    gap = HeldOutGap("", "1", 0.5, 0.5 * (1.0 - shrink), 0.5, "b@joint:x", shrink, interval, margin, (), ())
    selection = replace(
        chosen_from([cast("Fit", fit)]), rivals=(), excess=0.0, remaining=0.0,
        held_out_excess=given["there"], held_out_remaining=0.0, held_out_gain=given["won"],
        held_out_expected=39.0,
    )  # fmt: skip
    outcome = decide(selection, [first], [], [], HowFar(gap, ()), VerdictSettings())
    assert outcome.verdict == verdict


@pytest.mark.parametrize(
    ("first", "rivals", "verdict"),
    [
        (0.06, (0.082, 0.035, 0.017), "ambiguous"),
        (0.06, (0.02, 0.02, 0.02), "effect"),  # three times as probable as the next
        (0.55, (0.14, 0.1, 0.1), "effect"),
        (0.95, (0.03, 0.02), "effect"),
    ],
)
def test_what_a_rival_is_as_probable_as_is_no_name(
    first: float, rivals: tuple[float, ...], verdict: str
) -> None:
    """A gravity that the law lacked was "friction by position, probability 6 %", and a rival had 8 %.

    With half of the torque unexplained dozens of rivals shared the rest, so that none had 15 %.
    """
    effect = SimpleNamespace(limits_motion=False, by_chance=False)
    fit = cast("Fit", SimpleNamespace(hypotheses=(SimpleNamespace(effect=effect),), log_evidence=900.0))
    named = [
        cast("NamedEffect", SimpleNamespace(name=f"{name}@joint:x", probability=p, gain=900.0))
        for name, p in zip("abcd", (first, *rivals), strict=False)
    ]
    gap = HeldOutGap("", "1", 1.1, 0.4, None, None, 0.62, (0.56, 0.68), None, (), ())
    selection = replace(chosen_from([fit]), rivals=())
    outcome = decide(selection, named[:1], named[1:], [], HowFar(gap, ()), VerdictSettings())
    assert outcome.verdict == verdict
    if verdict == "ambiguous":
        assert outcome.tied == ("b@joint:x", "c@joint:x")
