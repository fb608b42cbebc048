"""Times of actions from the marks of a run, worked out by hand."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import pytest

from samrl_core.common.errors import InputError
from samrl_core.studies.speed.time_per_action import ActionTime, time_per_action, times_of

MARKS = [
    (0.0, "episode 0"),
    (0.1, "update"),
    (0.6, "view"),
    (0.9, "look"),
    (1.9, "update"),
    (2.1, "act"),
    (2.2, "move"),
    (2.6, "update"),
    (2.9, "act"),
    (2.95, "move"),
    (3.45, "update"),
    (3.7, "end"),
]


def test_parts_of_two_actions() -> None:
    found = times_of(MARKS)
    expected = [
        ActionTime(update=0.7, view=0.3, act=0.1, camera=1.0, tool=0.4),
        ActionTime(update=0.3, act=0.05, tool=0.5),  # the update after it found the task done
    ]
    assert len(found) == 2
    for one, other in zip(found, expected, strict=True):
        assert asdict(one) == pytest.approx(asdict(other))
        assert one.whole == pytest.approx(other.whole)


def test_an_action_that_was_cut_off_is_none() -> None:
    assert times_of([(0.0, "update"), (0.5, "act"), (0.6, "end")]) == []
    # The tool was on its way when a fault ended the episode: the action was begun, and counts.
    assert len(times_of([(0.0, "update"), (0.5, "act"), (0.6, "move"), (0.8, "end")])) == 1


def test_a_run_is_summed_up(tmp_path: Path) -> None:
    summary = {
        "task": "peg_insertion",
        "settings": {},
        "timing": {"real_time_factor_median": 0.9},
        "episodes": [{"marks": MARKS}, {"marks": MARKS[:2]}],
    }
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    found = time_per_action(tmp_path)
    assert found["episodes"] == 1 and found["whole_s"]["n"] == 2
    assert found["whole_s"]["median"] == pytest.approx((2.5 + 0.85) / 2)
    assert found["with_a_new_view_s"]["median"] == pytest.approx(2.5)
    assert found["without_s"]["n"] == 1
    assert sum(found["share_of_time"].values()) == pytest.approx(1.0)
    assert json.loads((tmp_path / "time_per_action.json").read_text()) == found
    assert (tmp_path / "time_per_action.png").stat().st_size > 10_000


def test_folders_without_times_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="has no times"):
        time_per_action(tmp_path)
    summary = {"task": "t", "settings": {}, "timing": {}, "episodes": [{"episode": 0}]}
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    with pytest.raises(InputError, match="marks"):
        time_per_action(tmp_path)
    (tmp_path / "summary.json").write_text(json.dumps({**summary, "episodes": [{"marks": []}]}))
    with pytest.raises(InputError, match="no episode"):
        time_per_action(tmp_path)
