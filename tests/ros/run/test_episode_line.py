"""The line of an episode at the end of a run."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from samrl_core.cell.tasks import task_named
from samrl_core.cell.tasks.spatula_flipping.task import PANCAKE
from samrl_ros.cell.run import _line, _result
from samrl_ros.cell.summary import _evaluate


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
    # What the operator of a real cell judges has no force that anybody knows.
    real = _line({**about, **ended, "success": success, "peak_contact_force_N": float("nan")}, True)
    assert says.partition(",")[0] in real and "nan" not in real


@pytest.mark.parametrize(
    ("judged", "by", "says"),
    [
        (3, "truth", "2 of 3 episodes succeeded by evaluation truth (95 %: 0.20-0.90)"),
        (2, "operator", "2 of 2 episodes succeeded by the operator's word (95 %: 0.20-0.90); 1 not judged"),
        (0, None, "3 episodes; nobody judged them"),
    ],
)
def test_what_nobody_judged_is_no_failure(judged: int, by: str | None, says: str) -> None:
    interval = (0.2, 0.9)
    summary = {"episodes": [{}] * 3, "successes": 2, "judged": judged, "judged_by": by}
    assert _result({**summary, "success_rate_wilson95": interval}).startswith(says)


@pytest.mark.parametrize(("name", "told"), [("spatula_flipping", True), ("spatula_flipping_hard", False)])
def test_what_slides_before_it_is_touched_has_no_error_of_its_place(name: str, told: bool) -> None:
    """A pan that is shaken moves the hard pancake by 33 mm; its images were said to be wrong by that."""
    task = task_named(name)
    values = np.array([p.nominal for p in task.parameters()])
    place = task.body_poses(values)[PANCAKE]
    lies = {PANCAKE: place.position.tolist()}
    end: dict[str, Any] = {
        "seed": 4, "body_position": lies, "body_quat_xyzw": {PANCAKE: place.quat_xyzw.tolist()},
        "body_speed": {PANCAKE: 0.0}, "body_peak_height": {PANCAKE: 0.01}, "tip_position": [0.4, 0.0, 0.1],
        "chain_points": [], "first_contact_ns": 9, "peak_contact_force": 0.0,
    }  # fmt: skip
    state = SimpleNamespace(header=SimpleNamespace(stamp=SimpleNamespace(sec=0, nanosec=5)), values=values)
    said = _evaluate({"start": {"body_position": lies}, "end": end}, [state], task)
    assert np.isfinite(said["estimate_error_before_contact_m"]) == told
