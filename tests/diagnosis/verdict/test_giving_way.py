"""A candidate that is refused gives way to the next one: who is next, who is no rival any more."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest

from samrl_core.diagnosis.effects import EFFECTS
from samrl_core.diagnosis.result import HeldOutGap
from samrl_core.diagnosis.selection import selection
from samrl_core.diagnosis.selection.contenders import contend
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit
from samrl_core.diagnosis.selection.selection import Selection
from samrl_core.diagnosis.selection.settings import SelectionSettings
from samrl_core.diagnosis.verdict import judge
from samrl_core.diagnosis.verdict.how_far import HowFar
from samrl_core.diagnosis.verdict.judge import Judge, Judged, comes_as_close
from samrl_core.diagnosis.verdict.rules import Decision, VerdictSettings, unconfirmed
from tests.diagnosis.selection.bench import judge_without_recordings

if TYPE_CHECKING:
    from samrl_core.diagnosis.residuals.likelihood import Likelihood
    from samrl_core.diagnosis.result import NamedEffect


def fit(name: str, gain: float) -> Fit:
    """A fit that has a name and evidence and nothing else."""
    family = name.partition("@")[0]
    contains = next((e.contains for e in EFFECTS if e.family == family), ())
    kinds = {"of_description": False, "contains": contains, "parameters": (), "renamed_shapes": ()}
    effect = SimpleNamespace(family=family, limits_motion=family == "torque_saturation", **kinds)
    form = SimpleNamespace(refine={})
    one = SimpleNamespace(name=name, place=name.partition("@")[2], effect=effect, form=form, shape={})
    return Fit(cast("Any", (one,)), (np.zeros(1),), np.eye(1), gain)


@dataclass
class StatedEvidence:
    """Evidence whose remainders are stated, by name [nat]."""

    left: dict[str, float]
    correlation_time: float = 1.0

    @property
    def likelihood(self) -> Any:
        return SimpleNamespace(deficit=lambda y, k: float(y), trials=())

    def remainder(self, of: Fit) -> float:
        return self.left[of.hypotheses[0].name]

    def refine(self, of: Fit, index: int) -> Fit:
        return of


def order_of(singles: list[Fit], left: dict[str, float], excess: float) -> list[str]:
    evidence = cast("Evidence", StatedEvidence(left))
    return [c.fit.hypotheses[0].name for c in contend(evidence, singles, excess, 12.0)]


def test_an_equation_met_to_the_last_leaves_others_within_reach() -> None:
    """A controller's gain left nothing of 34 nat; delay and friction with 30 and 29 were out of reach."""
    singles = [
        fit("controller_gain@joint:x", 34.0),
        fit("command_delay@joint:x", 30.0),
        fit("b@joint:x", 29.0),
    ]
    names = [f.hypotheses[0].name for f in singles]
    assert order_of(singles, dict.fromkeys(names, 0.0), 34.0) == names


def test_what_is_beyond_reach_waits_behind_if_it_explains_most_of_what_the_best_does() -> None:
    """A dead band with 0.76 of a saturation's evidence was never tried; what has 0.4 of it is not."""
    singles = [
        fit("torque_saturation@joint:z", 9081.0),
        fit("dead_band@joint:z", 6882.0),
        fit("c@joint:z", 3600.0),
    ]
    left = {"torque_saturation@joint:z": 500.0, "dead_band@joint:z": 2000.0, "c@joint:z": 5000.0}
    assert order_of(singles, left, 9081.0) == ["torque_saturation@joint:z", "dead_band@joint:z"]


def test_a_limit_keeps_nobody_out_of_reach() -> None:
    """A presliding with 0.748 of the evidence of one that takes off all torque beyond it was never tried."""
    left = {"torque_saturation@joint:x": 400.0, "presliding@joint:x": 2000.0, "coulomb@joint:x": 6700.0}
    singles = [fit(name, 7930.0 - extra) for name, extra in zip(left, (0.0, 1997.0, 6680.0), strict=True)]
    assert order_of(singles, left, 7930.0) == ["torque_saturation@joint:x", "presliding@joint:x"]
    other = fit("gear_ripple@joint:x", 7930.0)
    assert order_of([other, *singles[1:]], {**left, "gear_ripple@joint:x": 400.0}, 7930.0) == [
        "gear_ripple@joint:x"
    ]


def test_below_the_threshold_nothing_waits() -> None:
    singles = [fit("a@joint:x", 14.0), fit("b@joint:x", 11.0)]
    assert order_of(singles, {"a@joint:x": 0.0, "b@joint:x": 9.0}, 60.0)[0] == "a@joint:x"
    singles = [fit("a@joint:x", 40.0), fit("b@joint:x", 31.0), fit("b@joint:y", 31.0)]
    assert order_of(singles, {"a@joint:x": 0.0, "b@joint:x": 9.0, "b@joint:y": 9.0}, 40.0) == [
        "a@joint:x", "b@joint:x",
    ]  # fmt: skip


def a_selection(first: Fit, others: tuple[Fit, ...]) -> Selection:
    def again(other: Fit) -> Selection:
        rest = tuple(f for f in (first, *others) if f is not other)
        return replace(made, chosen=other, rivals=rest, again=again, denied=frozenset())

    made = Selection(
        first, (first, *others), others, 12.0, 50.0, 1.0, 50.0, 1.0, 1.0, contenders=others, again=again
    )
    return made


def judged_by(monkeypatch: pytest.MonkeyPatch, refused: set[str]) -> list[Selection]:
    """The selections that are judged, where first effects of these names are refused."""
    seen: list[Selection] = []

    def judge_set(self: Judge, tried: Selection) -> tuple[Judged, tuple[int, ...]]:
        assert tried.chosen is not None
        name = tried.chosen.hypotheses[0].name
        verdict = "none_of_mine" if name in refused else "effect"
        named = cast("NamedEffect", SimpleNamespace(name=name, gain=tried.chosen.log_evidence))
        seen.append(tried)
        one = Judged(tried, (named,), (), (), HowFar(None, ()), Decision(verdict, ()))
        return one, (0,) if name in refused else ()

    monkeypatch.setattr(Judge, "judge_set", judge_set)
    return seen


def test_what_was_refused_is_no_rival_of_the_next_candidate(monkeypatch: pytest.MonkeyPatch) -> None:
    """A friction was said to be tied with the saturation that had been refused, itself at 0 %."""
    first, second = fit("torque_saturation@joint:x", 2371.0), fit("viscous_friction@joint:x", 2000.0)
    seen = judged_by(monkeypatch, {first.hypotheses[0].name})
    found = judge_without_recordings().judge_first(a_selection(first, (second,)))
    assert found.outcome.verdict == "effect" and found.named[0].name == "viscous_friction@joint:x"
    assert [s.denied for s in seen] == [frozenset(), {"torque_saturation@joint:x"}]


@pytest.mark.parametrize(("alone", "next_"), [(30.0, "a@joint:x"), (-np.inf, "b@joint:x")])
def test_what_is_impossible_without_its_further_member_gives_way(
    monkeypatch: pytest.MonkeyPatch, alone: float, next_: str
) -> None:
    """A diagnosis ended without a report: no set that was left had any probability."""
    one = a_selection(fit("a@joint:x", 50.0), (fit("b@joint:x", 20.0),))
    left = replace(one, chosen=fit("a@joint:x", alone))
    monkeypatch.setattr(judge, "without_member", lambda *_: left)
    empty = cast("Likelihood", None)
    attempts = judge._attempts(empty, empty, one)
    assert next(attempts) is one
    tried = attempts.send((1,)).chosen
    assert tried is not None and tried.hypotheses[0].name == next_


def test_without_simulation_held_out_torque_says_who_comes_as_close(monkeypatch: pytest.MonkeyPatch) -> None:
    """Next candidates were never named where nothing could be simulated."""
    first, second = fit("a@joint:x", 34.0), fit("b@joint:x", 30.0)
    judged_by(monkeypatch, {"a@joint:x"})
    one = a_selection(first, (second,))
    worse = replace(one, again=lambda other: replace(a_selection(other, ()), held_out_remaining=10.0))
    for made, name in ((one, "b@joint:x"), (worse, "a@joint:x")):
        assert judge_without_recordings().judge_first(made).named[0].name == name


def test_a_cause_that_wider_tolerances_swallow_gives_way(monkeypatch: pytest.MonkeyPatch) -> None:
    swallowed, stands, weak = fit("a@joint:x", 34.0), fit("b@joint:x", 30.0), fit("c@joint:x", 20.0)
    standing = {"b@joint:x", "c@joint:x"}
    monkeypatch.setattr(selection, "_stands_wide", lambda e, f, s: f.hypotheses[0].name in standing)

    def order(singles: list[Fit]) -> list[str]:
        nobody = cast("Evidence", None)
        out = selection._standing_first(nobody, singles, 12.0, SelectionSettings())
        return [f.hypotheses[0].name for f in out]

    assert order([swallowed, stands, weak]) == ["b@joint:x", "a@joint:x", "c@joint:x"]
    assert order([swallowed, weak]) == ["a@joint:x", "c@joint:x"]  # the gap is mostly the swallowed one's


def test_a_gap_of_much_evidence_is_none_of_mine_when_its_cause_is_denied() -> None:
    """A slipping clutch: 1250 nat, tolerances swallow all but 173, the nearest effect is contradicted."""
    chosen = a_selection(fit("encoder_eccentricity@joint:x", 1250.0), ())
    refused = Decision("none_of_mine", (), contradicted=True)
    for gain, verdict in ((1250.0, None), (40.0, "no_gap")):
        named = cast("NamedEffect", SimpleNamespace(name="encoder_eccentricity@joint:x", gain=gain))
        found = unconfirmed(refused, chosen, named, VerdictSettings())
        assert (None if found is None else found.verdict) == verdict
    # A gantry with nothing wrong: laws that undo each other won 137 nat where nothing exceeds noise.
    named = cast("NamedEffect", SimpleNamespace(name="command_low_pass@arm:x", gain=137.0))
    within = replace(chosen, excess=2.0, held_out_excess=0.0)
    found = unconfirmed(refused, within, named, VerdictSettings())
    assert found is not None and found.verdict == "no_gap"


def test_a_refused_effect_that_is_hardly_believed_is_no_gap_where_nothing_exceeds_noise() -> None:
    """A servo arm with nothing wrong: 12.2 of log evidence where 12 are needed, 5 nat beyond noise."""
    refused = Decision("none_of_mine", ())
    named = cast("NamedEffect", SimpleNamespace(name="model_scale@arm:x", gain=2.7))
    chosen = a_selection(fit("model_scale@arm:x", 2.7), ())
    quiet = replace(chosen, excess=5.4, held_out_excess=0.0, threshold=12.0)

    def verdict(selection: Selection) -> str | None:
        found = unconfirmed(refused, selection, named, VerdictSettings())
        return None if found is None else found.verdict

    assert verdict(replace(quiet, most=12.2)) == "no_gap"
    assert verdict(replace(quiet, most=30.0)) is None  # more than chance brings
    assert verdict(replace(quiet, most=12.2, excess=40.0)) is None  # seen without it


def gap_shrunk_by(shrink: float | None) -> HeldOutGap:
    """A gap on held-out recordings."""
    return HeldOutGap("m", "1", 1.0, None, None, None, shrink, None, None, (), ())


def test_a_term_that_held_out_recordings_need_is_not_left_out_for_a_plainer_family() -> None:
    """Coulomb friction for one that depends on the direction brought them 58 % closer, that 90 %."""
    assert not comes_as_close(gap_shrunk_by(0.58), gap_shrunk_by(0.90))
    assert comes_as_close(gap_shrunk_by(0.88), gap_shrunk_by(0.90))
    assert comes_as_close(gap_shrunk_by(None), gap_shrunk_by(0.90)) and comes_as_close(None, None)
