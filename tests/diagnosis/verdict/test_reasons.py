"""What a verdict says of held-out recordings."""

from __future__ import annotations

from dataclasses import replace

import pytest

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
