"""A set that is tried after one was refused, with the refused effect as its further member."""

from __future__ import annotations

import pytest

from samrl_core.diagnosis.result import HeldOutGap, NamedEffect
from samrl_core.diagnosis.selection.selection import Selection
from samrl_core.diagnosis.verdict.how_far import HowFar
from samrl_core.diagnosis.verdict.judge import Judged, _replaces
from samrl_core.diagnosis.verdict.rules import Decision
from tests.diagnosis.verdict.test_giving_way import fit

DRY, WET = "coulomb_friction@joint:slide", "viscous_friction@joint:slide"


def judged(names: tuple[str, ...], left: float, shrink: float, verdict: str) -> Judged:
    """A set that leaves so much [nat] of 12,136 on fitted recordings, and of 5,000 on held-out ones."""
    chosen = fit(names[0], 11_000.0)
    selection = Selection(chosen, (chosen,), (), 12.0, 12_136.0, left, 5_000.0, left, 22.6)
    gap = HeldOutGap("RMS", "1", 5.0, 5.0 * (1.0 - shrink), None, None, shrink, (0.1, 0.9), None, ())
    named = tuple(NamedEffect(*name.split("@"), 1.0, {}) for name in names)
    return Judged(selection, named, (), (), HowFar(gap, ()), Decision(verdict, ()))


@pytest.mark.parametrize(
    ("names", "left", "stands"),
    [((WET, DRY), 112.0, True), ((WET, DRY), 400.0, False), ((WET,), 112.0, True)],
    ids=["explains the rest", "the same in another order", "without the refused one"],
)
def test_a_refused_effect_stands_beside_what_explains_its_rest(
    names: tuple[str, ...], left: float, stands: bool
) -> None:
    """EMPS, its late velocity set apart: Coulomb friction alone left 564 nat, and nothing was named."""
    refused = judged((DRY,), 564.0, 0.70, "none_of_mine")
    assert _replaces(judged(names, left, 0.82, "effect"), refused) is stands


def test_a_refused_set_is_not_named_in_another_order() -> None:
    refused = judged((DRY, WET), 564.0, 0.70, "none_of_mine")
    assert not _replaces(judged((WET, DRY), 112.0, 0.82, "effect"), refused)


@pytest.mark.parametrize(
    ("names", "stands"),
    [
        (("friction_asymmetry@joint:slide",), True),
        (("friction_asymmetry@joint:other",), False),
        (("viscous_friction@joint:slide",), False),
    ],
    ids=["what contains it", "elsewhere", "another"],
)
def test_a_refused_formula_gives_way_to_one_that_contains_it(names: tuple[str, ...], stands: bool) -> None:
    """EMPS by its law alone: dry friction was 0.68 of its size one way and 1.13 the other, and refused.

    One that depends on the direction has the published size; it shrank the gap by 52 %, not by 57 %.
    """
    refused = judged((DRY,), 112.0, 0.57, "none_of_mine")
    assert _replaces(judged(names, 110.0, 0.50, "effect"), refused) is stands
