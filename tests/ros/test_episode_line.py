"""The line of an episode at the end of a run."""

from __future__ import annotations

import pytest

from samrl_ros.cell.run import _line


@pytest.mark.parametrize(
    ("success", "says"),
    [
        (True, "success, 42 actions"),
        (False, "failure, largest force 14.3 N, 42 actions"),
        (None, "not judged, 42"),
    ],
)
def test_a_failure_says_how_hard_it_pressed(success: bool | None, says: str) -> None:
    """A pancake may lie turned over and have failed by the force that it took."""
    force = 14.2858 if success is not None else float("nan")
    about = {"episode": 0, "seed": 7, "actions": 42, "views": [], "wall_time_s": 9.0, "reason": "done"}
    ended = {"final_error_m": 0.0137, "estimate_error_before_contact_m": 0.0049}
    line = _line({**about, **ended, "success": success, "peak_contact_force_N": force}, True)
    assert f"episode 0 (seed 7): {says}" in line
