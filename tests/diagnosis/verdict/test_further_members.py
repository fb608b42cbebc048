"""A further effect is named where something certain speaks for it, and where it is another than the first."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.result import HeldOutGap, NamedEffect, ParameterEstimate
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, Hypothesis
from samrl_core.diagnosis.selection.search import find_extensions
from samrl_core.diagnosis.selection.selection import Selection
from samrl_core.diagnosis.verdict import judge
from samrl_core.diagnosis.verdict.further_members import find_superfluous
from samrl_core.diagnosis.verdict.how_far import HowFar, how_far
from samrl_core.diagnosis.verdict.judge import Judge, Judged
from samrl_core.diagnosis.verdict.rules import Decision
from tests.diagnosis.selection.bench import Bench, judge_without_recordings


def selection_of(fit: Fit) -> Selection:
    return Selection(fit, (fit,), (), 12.0, 100.0, 1.0, 100.0, 1.0, 2.0)


def named(effect: str, **intervals: tuple[float, float]) -> NamedEffect:
    sizes = {name: ParameterEstimate(sum(ends) / 2.0, "1", ends) for name, ends in intervals.items()}
    family, _, place = effect.partition("@")
    return NamedEffect(family, place, 1.0, sizes)


def member(shape: tuple[str, ...] = (), limit: bool = False) -> Hypothesis:
    effect = SimpleNamespace(renamed_shapes=(), limits_motion=limit)
    return cast("Hypothesis", SimpleNamespace(effect=effect, shape=dict.fromkeys(shape, 1.0)))


GAINS = named("controller_gain@joint:b", eK=(-0.51, -0.46), eD=(-0.05, 0.01))


@pytest.mark.parametrize(
    ("second", "shape", "takes_off", "left_out"),
    [
        (named("payload@arm:a", mass=(-0.03, 0.01), com_x=(-0.6, 0.4)), (), (0.01, 0.02), True),
        (named("payload@arm:a", mass=(0.1, 0.2), com_x=(-0.6, 0.4)), (), (0.01, 0.02), False),
        (named("reflected_inertia@joint:a", Ja=(0.03, 0.07)), (), (-0.001, 0.004), True),
        (named("reflected_inertia@joint:a", Ja=(0.03, 0.07)), (), None, False),  # not simulated
        (named("command_delay@joint:a", T=(0.01, 0.02)), ("T",), (0.1, 0.2), False),  # a shape is no size
    ],
    ids=["may be zero", "certain", "takes off nothing", "not simulated", "a shape"],
)
def test_a_further_effect_needs_something_certain(
    second: NamedEffect, shape: tuple[str, ...], takes_off: tuple[float, float] | None, left_out: bool
) -> None:
    """A leg's gain was off by half; beside it stood a payload of -12 [-33, 7] g and a rotor's inertia."""
    fit = Fit((member(), member(shape)), (np.ones(1), np.ones(1)), np.eye(2), 100.0)
    far = HowFar(None, (), further={} if takes_off is None else {1: takes_off})
    assert find_superfluous(selection_of(fit), [GAINS, second], far) == ((1,) if left_out else ())


@pytest.mark.parametrize(
    ("limit", "takes_off", "together", "left_out"),
    [
        (False, (0.06, 0.10), 0.60, False),
        (False, (0.06, 0.10), 0.19, True),
        (True, (0.06, 0.10), 0.60, True),
        (True, (0.20, 0.40), 0.60, False),
    ],
    ids=["most is gone", "most stays", "a limit that is hardly seen", "a limit"],
)
def test_several_effects_take_much_of_the_gap_together(
    limit: bool, takes_off: tuple[float, float], together: float, left_out: bool
) -> None:
    """A hobby arm's delay was friction, a limit of the torque's rate and an inertia, and 81 % of the gap."""
    second = named("torque_rate_limit@arm:a", R=(3.0, 4.0))
    fit = Fit((member(), member(("R",), limit)), (np.ones(1), np.ones(1)), np.eye(2), 100.0)
    gap = HeldOutGap("RMS", "1", 2.0, 2.0 * (1.0 - together), None, None, together, (0.1, 0.9), None, ())
    far = HowFar(gap, (), further={1: takes_off})
    assert find_superfluous(selection_of(fit), [GAINS, second], far) == ((1,) if left_out else ())


def test_what_explains_all_of_its_own_place_shares_out_nothing() -> None:
    """A mount yielded, and a wrist's Stribeck friction was all of the wrist's torque, but 2 % of the gap."""
    second = named("stribeck_friction@joint:b", drop=(0.39, 0.47))
    fit = Fit((member(), member()), (np.ones(1), np.ones(1)), np.eye(2), 100.0)
    gap = HeldOutGap("RMS", "1", 2.0, 1.68, None, None, 0.16, (0.12, 0.20), None, ())
    far = HowFar(gap, (), further={1: (0.017, 0.027)}, alone=frozenset({1}))
    assert find_superfluous(selection_of(fit), [GAINS, second], far) == ()
    assert find_superfluous(selection_of(fit), [GAINS, second], replace(far, alone=frozenset())) == (1,)
    left = replace(selection_of(fit), remaining=20.0)
    assert find_superfluous(left, [GAINS, second], replace(far, further={1: (-0.1, 0.1)})) == (1,)


@pytest.mark.parametrize(
    ("left", "takes_off", "left_out"),
    [(0.3, (-0.004, 0.02), False), (0.3, (-0.02, -0.004), True), (20.0, (-0.004, 0.02), True)],
    ids=["motion hardly shows it", "motion denies it", "torque stays"],
)
def test_motion_that_a_loop_holds_need_not_show_a_drive(
    left: float, takes_off: tuple[float, float], left_out: bool
) -> None:
    """A drive 11 % too weak beside a friction: all of its torque, 2583 of 2593 as foretold, and no motion."""
    second = named("actuator_gain@joint:b", e=(-0.12, -0.11))
    fit = Fit((member(), member()), (np.ones(1), np.ones(1)), np.eye(2), 100.0)
    gap = HeldOutGap("RMS", "1", 1.37, 1.21, None, None, 0.12, (0.06, 0.18), None, ())
    far = HowFar(gap, (), further={1: takes_off}, alone=frozenset({1}))
    selection = replace(selection_of(fit), remaining=left, held_out_remaining=left)
    assert find_superfluous(selection, [GAINS, second], far) == ((1,) if left_out else ())


@pytest.mark.parametrize(("second", "there"), [(0.4, True), (0.0, False)], ids=["there", "not there"])
def test_what_a_further_effect_takes_off_the_gap_has_an_interval(second: float, there: bool) -> None:
    """On a held-out recording, with the set fitted again without it."""
    bench = Bench(1.0, 0.4)
    like, other = bench.white(bench.unseen), bench.white(bench.unseen)
    bench.set_residual(bench.unseen, like + second * other)
    one = bench.made("first", bench.columns[0], like)
    two = bench.made("second", bench.columns[1], other)
    pair = bench.evidence.fit([one, two])
    held_out = Likelihood([bench.unseen])
    rng = np.random.default_rng(0)
    far = how_far(held_out, selection_of(pair), False, rng, fitted=bench.evidence.likelihood)
    low, high = far.further[1]
    assert low < high < 1.0
    assert (low > 0.0) is there
    assert (1 in far.alone) is there


@pytest.mark.parametrize("refused", [False, True], ids=["stands without", "falls without"])
def test_a_superfluous_effect_is_left_out_if_the_others_stand(
    monkeypatch: pytest.MonkeyPatch, refused: bool
) -> None:
    pair = Fit((member(), member()), (np.ones(1), np.ones(1)), np.eye(2), 100.0)
    single = replace(pair, hypotheses=pair.hypotheses[:1], amplitudes=pair.amplitudes[:1])
    second = named("payload@arm:a", mass=(-0.03, 0.01))

    def judge_set(self: Judge, tried: Selection) -> tuple[Judged, tuple[int, ...]]:
        assert tried.chosen is not None
        alone = len(tried.chosen.hypotheses) == 1
        verdict = "none_of_mine" if alone and refused else "effect"
        effects = (GAINS,) if alone else (GAINS, second)
        return Judged(tried, effects, (), (), HowFar(None, ()), Decision(verdict, ())), ()

    monkeypatch.setattr(Judge, "judge_set", judge_set)
    monkeypatch.setattr(judge, "without_member", lambda likelihood, held, was, members: selection_of(single))
    found = judge_without_recordings().judge_first(selection_of(pair))
    assert found.named == ((GAINS, second) if refused else (GAINS,))


def test_a_friction_that_another_contains_is_no_further_effect() -> None:
    """An asymmetry had a Coulomb friction of 3.2 N beside it, and an own mean that held zero."""
    bench = Bench(1.0, 0.4)
    chosen = bench.evidence.fit([bench.first])
    (found,) = find_extensions(bench.evidence, [bench.second], chosen)
    assert [h.effect.family for h in found.hypotheses] == ["first", "second"]
    bench.first.effect.__dict__["contains"] = ("second",)
    assert not find_extensions(bench.evidence, [bench.second], chosen)


def test_what_stood_beside_a_superfluous_effect_goes_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """A leg's payload went, and the inertia that had stood beside it was no law any more."""
    third = named("reflected_inertia@joint:a", Ja=(0.03, 0.07))
    of = {1: (GAINS,), 2: (GAINS, third), 3: (GAINS, third, named("payload@arm:a", mass=(-0.03, 0.01)))}
    sets = {k: Fit(tuple(member() for _ in range(k)), (np.ones(1),) * k, np.eye(k), 100.0) for k in of}

    def judge_set(self: Judge, tried: Selection) -> tuple[Judged, tuple[int, ...]]:
        assert tried.chosen is not None
        count = len(tried.chosen.hypotheses)
        verdict, denied = ("none_of_mine", (1,)) if count == 2 else ("effect", ())
        return Judged(tried, of[count], (), (), HowFar(None, ()), Decision(verdict, ())), denied

    def without(likelihood: Any, held: Any, was: Selection, members: tuple[int, ...]) -> Selection:
        assert was.chosen is not None
        return selection_of(sets[len(was.chosen.hypotheses) - len(members)])

    monkeypatch.setattr(Judge, "judge_set", judge_set)
    monkeypatch.setattr(judge, "without_member", without)
    found = judge_without_recordings().judge_first(selection_of(sets[3]))
    assert found.named == (GAINS,)


def test_forms_are_those_of_the_recording_that_shows_most() -> None:
    """A leg's first recording never reached its limit, so that no gain was tried whose torque is clipped."""
    bench = Bench(1.0, 0.4)
    more = (bench.first.form, bench.second.form)
    effect = SimpleNamespace(
        family="a", prior_cost=0.0, why_unobservable=lambda trial: None, places=lambda trial: (None,),
        forms=lambda trial, place: more if trial is bench.unseen else more[:1],
    )  # fmt: skip
    for form in more:
        form.__dict__["shapes"] = ({},)
    whole = Evidence(Likelihood([bench.fitted, bench.unseen]))
    assert [h.form for h in whole.screen([cast("Any", effect)])] == list(more)
