"""What a verdict says of held-out recordings."""

from __future__ import annotations

from dataclasses import replace

import pytest

from samrl_core.diagnosis.report.terminal import summary
from samrl_core.diagnosis.result import IN_TOLERANCES
from samrl_core.diagnosis.verdict.decision import VerdictSettings
from samrl_core.diagnosis.verdict.missed_motion import moves_off, what_stays
from samrl_core.diagnosis.verdict.rules import how_it_moves
from tests.diagnosis.report import samples


@pytest.mark.parametrize(
    ("shrink", "said"), [(0.83, "shrinks by 83%"), (0.004, "does not shrink"), (-0.08, "does not shrink")]
)
def test_a_gap_that_stays_is_no_reason_for_a_name(shrink: float, said: str) -> None:
    """Among the reasons for a payload stood "shrinks by -0%"."""
    gap = samples.diagnosis("effect").gap
    assert gap is not None
    told = how_it_moves(replace(gap, shrink=shrink))
    assert said in told and ("something else is off" in told) == (shrink < 0.005)


@pytest.mark.parametrize(
    ("nominal", "metric", "said"),
    [(9.5, IN_TOLERANCES, True), (2.9, IN_TOLERANCES, False), (9.5, "position error", False)],
)
def test_no_gap_of_torques_says_that_motion_is_off(nominal: float, metric: str, said: bool) -> None:
    """ "Model and machine agree" stood beside 9.5 tolerances, and no reason spoke of them."""
    d = samples.diagnosis("no_gap")
    assert d.gap is not None
    gap = replace(d.gap, nominal=nominal, metric=metric)
    off = moves_off(gap, VerdictSettings())
    assert bool(off) == said and moves_off(None, VerdictSettings()) == ()
    lines = " ".join(summary(replace(d, gap=gap, reasons=(*d.reasons, *off))))
    assert ("9.5 tolerances off" in lines) == said


@pytest.mark.parametrize(
    ("left", "metric", "within"),
    [(0.65, IN_TOLERANCES, True), (1.2, IN_TOLERANCES, False), (0.65, "position error", False)],
)
def test_what_is_left_within_tolerance_is_said_to_be(left: float, metric: str, within: bool) -> None:
    """A cable left "85 % of the held-out gap" of 0.77 tolerances, a rotor "more, and smaller"."""
    d = samples.diagnosis("effect")
    assert d.gap is not None
    gap = replace(d.gap, nominal=left / 0.85, with_effect=left, shrink=0.15, metric=metric)
    text = " ".join(" ".join(summary(replace(d, gap=gap))).split())
    assert ("85 % (within tolerance) of the held-out gap" in text) == within
    assert ("85 % of the held-out gap" in text) != within
    stays = what_stays(0.54, "payload@arm:tool_arm", gap)
    assert ("there is more" in stays) != within and ("within tolerance" in stays) == within
