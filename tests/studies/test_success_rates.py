"""Figures of many episodes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from samrl_core.common.errors import InputError
from samrl_core.studies.episodes.stopwatch import GROUPS, Stopwatch
from samrl_core.studies.episodes.success_rates import compared, rates, write_bars


def case(seed: int, success: bool, believed: bool | None = None, **more: Any) -> dict[str, Any]:
    believed = success if believed is None else believed
    return {
        "key": str(seed),
        "seed": seed,
        "success": success,
        "believed": believed,
        "why": "" if success else "done" if believed else "action_limit",
        "final_error": 0.001,
        "actions": 10,
        "camera_moves": seed % 2,
        "simulated_s": 8.0,
        "cpu_s": dict.fromkeys(GROUPS, 1.0),
        "wall_s": dict.fromkeys(GROUPS, 2.0),
        **more,
    }


def test_rates() -> None:
    """Shares, the model's word against truth, reasons, and times by action."""
    cases = [case(0, True), case(1, False), case(2, False, True), case(3, True, False)]
    found = rates(cases)
    assert (found["value"], found["successes"], found["trials"]) == (0.5, 2, 4)
    assert found["ci95"] == pytest.approx((0.150, 0.850), abs=1e-3)
    assert found["detector"]["successes"] == 2
    assert found["failures"] == {"action_limit": 1, "done": 1}
    assert found["camera_moves"] == 0.5
    assert found["cpu_s"] == 4.0
    assert found["wall_s_per_action"] == dict.fromkeys(GROUPS, pytest.approx(0.2))


def test_conditions_are_compared_on_seeds_that_both_have() -> None:
    """Ten wins and one loss among pairs: the exact test of McNemar says 12 / 2048."""
    first = [case(k, k != 11) for k in range(14)]
    second = [case(k, k >= 10) for k in range(12)]
    found = compared(first, second)
    assert found["pairs"] == 12
    assert found["gain"] == pytest.approx(9 / 12)
    low, high = found["gain_ci95"]
    assert 0.2 < low < 9 / 12 < high <= 1.0
    assert found["p_more_often"] == pytest.approx(12 / 2048)
    assert found["p_less_often"] == pytest.approx(2047 / 2048)
    with pytest.raises(InputError, match="no seed in common"):
        compared(first, [case(99, True)])


def test_bars_are_drawn(tmp_path: Path) -> None:
    rows = {"a": rates([case(0, True)]), "b": rates([case(0, False)])}
    write_bars({"peg_insertion": rows, "needle_threading": {"a": rows["a"]}}, "title", tmp_path / "p.png")
    assert (tmp_path / "p.png").stat().st_size > 5000


def test_a_stopwatch_counts_what_fails_too() -> None:
    watch = Stopwatch()
    with pytest.raises(ValueError), watch("look"):
        sum(range(200_000))
        raise ValueError
    with watch("move"):
        sum(range(200_000))
    assert watch.entered == {"look": 1, "move": 1}
    assert watch.cpu_s["move"] > 1e-4 and watch.wall_s["move"] > 1e-4
    assert watch.cpu_s["update"] == 0.0
