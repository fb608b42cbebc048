"""The time of an action goes to its parts, and all of it."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from samrl_core.errors import InputError
from samrl_ros.bench.action_times import EXECUTED, REQUEST, action_times, bench_actions
from samrl_ros.topics import arm_topic, cell_topic
from tests.ros.bag_files import record

STATE, TARGET = cell_topic("model_updater/state"), cell_topic("view_planner/target")
ACTION, CAMERA = cell_topic("view_planner/nominal_action"), arm_topic("camera_arm", "motion_status")


def events(episode: int, step: int, start: float, *rows: tuple[float, str]) -> list[tuple[float, str, Any]]:
    message = SimpleNamespace(episode=episode, step=step)
    return [(start + after, topic, message) for after, topic in rows]


def test_all_time_has_a_part() -> None:
    """An action with a view; one without; one that is never executed; one of the next episode."""
    first = events(
        0, 0, 1.0, (0.0, REQUEST), (0.5, STATE), (0.5, REQUEST), (1.5, TARGET), (2.25, CAMERA)
    ) + events(0, 0, 3.25, (0.0, REQUEST), (0.25, STATE), (0.25, REQUEST), (0.375, ACTION), (0.5, EXECUTED))
    second = events(0, 1, 4.0, (0.0, REQUEST), (0.25, STATE), (0.5, ACTION), (1.5, EXECUTED))
    dropped = events(0, 2, 6.0, (0.0, REQUEST), (0.25, STATE))
    stray = events(0, 1, 7.0, (0.0, ACTION))
    other = events(1, 0, 9.0, (0.0, REQUEST), (0.5, REQUEST), (1.0, STATE), (1.25, ACTION), (1.5, EXECUTED))
    found = list(action_times([*first, *second, *dropped, *stray, *other]))
    assert [(t.episode, t.step) for t in found] == [(0, 0), (0, 1), (1, 0)]
    assert found[0].seconds == {"update": 0.75, "view": 1.0, "act": 0.125, "move": 0.875}
    assert found[0].total == 2.75
    assert found[1].seconds == {"update": 0.25, "view": 0.0, "act": 0.25, "move": 1.0}
    assert found[2].seconds == {"update": 1.0, "view": 0.0, "act": 0.25, "move": 0.25}


def test_a_folder_without_a_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no summary of a finished run"):
        bench_actions([tmp_path], tmp_path / "out")


@pytest.mark.ros
def test_a_bag_becomes_a_table(tmp_path: Path) -> None:
    """Half as fast as real time: wall times are twice the bag's."""
    from samrl_msgs.msg import StepRequest, ToolAction

    run = tmp_path / "run"
    rows = [(0, REQUEST, StepRequest(stage="act")), (1_500_000_000, EXECUTED, ToolAction())]
    record(run / "bag", rows)
    settings = {"task": "peg_insertion", "policy": "learned", "strategy": "q"}
    episodes = [{"episode": 0, "wall_time_s": 20.0, "sim_time_s": 10.0}]
    (run / "summary.json").write_text(json.dumps({"settings": settings, "episodes": episodes}))
    assert bench_actions([run], tmp_path / "out") == 0
    found = json.loads((tmp_path / "out" / "time_per_action.json").read_text())["runs"][str(run)]
    assert found["mean_wall_s"] == {"update": 0.0, "view": 0.0, "act": 0.0, "move": 3.0}
    assert found["wall_s"]["p90"] == 3.0 and found["wall_s"]["share_within_goal"] == 0.0
    assert (found["task"], found["actions"], found["real_time_factor"]) == ("peg_insertion", 1, 0.5)
    assert (tmp_path / "out" / "time_per_action.png").is_file()
