"""The whole cell in one thread: episodes end as they should, and truth leaks into no message."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from samrl_core.cell.tasks import task_named
from samrl_core.cell.world.evaluation import ending_of, read_truth
from samrl_ros.contract.topics import TOPICS, cell_topic

pytest.importorskip("rclpy")
pytestmark = pytest.mark.ros
TASK, BODY = task_named("peg_insertion"), "hole_board"
STATE, OUTCOME = cell_topic("model_updater/state"), cell_topic("supervisor/outcome")
EXECUTED, TARGET = cell_topic("manipulator/executed_action"), cell_topic("view_planner/target")


def numbers_and_texts(value: Any) -> Iterator[float | str | np.ndarray]:
    """Every float and every text of a message; arrays whole."""
    if hasattr(value, "get_fields_and_field_types"):
        for name in value.get_fields_and_field_types():
            yield from numbers_and_texts(getattr(value, name))
    elif isinstance(value, (float, str)):
        yield value
    elif isinstance(value, (list, tuple)):
        for item in value:
            yield from numbers_and_texts(item)
    elif isinstance(value, np.ndarray) or type(value).__name__ == "array":
        if np.asarray(value).dtype.kind == "f":
            yield np.asarray(value, dtype=np.float64)


def contains(message: Any, *numbers: float) -> bool:
    """Whether a message holds one of the numbers within 1e-9: as float, in an image of floats, or as text."""
    wanted = np.array(numbers)
    if getattr(message, "encoding", "") == "32FC1":
        pixels = np.frombuffer(bytes(message.data), dtype=np.float32).astype(np.float64)
        return bool((np.abs(pixels[:, None] - wanted) < 1e-9).any())
    found = list(numbers_and_texts(message))
    texts = [item for item in found if isinstance(item, str)]
    if any(f"{abs(number):.12f}"[:-4] in text for number in numbers for text in texts):
        return True
    values = [np.ravel(item) for item in found if not isinstance(item, str)]
    if not values:
        return False
    return bool((np.abs(np.concatenate(values)[:, None] - wanted) < 1e-9).any())


def hole_truth(run: Any, event: str) -> np.ndarray:
    return np.array(read_truth(run.truth_file)[0][event]["body_position"][BODY])


def hole_estimate(state: Any) -> np.ndarray:
    return TASK.body_poses(np.array(state.values))[BODY].position


def test_three_actions_end_at_the_action_limit(three_actions: Any) -> None:
    (outcome,) = three_actions.on(OUTCOME)
    assert outcome.reason == "action_limit"
    assert outcome.actions == 3
    assert not outcome.detected_success
    assert [m.step for m in three_actions.on(EXECUTED)] == [0, 1, 2]
    assert [m.step for m in three_actions.on(STATE)] == [0, 0, 1, 2, 3]  # again at 0, from the better view
    assert [m.step for m in three_actions.on(TARGET) if m.move] == [0]


def test_executed_actions_follow_the_nominal_ones(three_actions: Any) -> None:
    for action in three_actions.on(EXECUTED):
        nominal = np.array([action.nominal.x, action.nominal.y, action.nominal.z])
        executed = np.array([action.executed.x, action.executed.y, action.executed.z])
        assert np.linalg.norm(nominal) > 1e-3
        assert np.linalg.norm(executed - nominal) < 2e-3


def test_the_model_finds_the_hole(three_actions: Any) -> None:
    states = three_actions.on(STATE)
    truth = hole_truth(three_actions, "end")
    assert np.linalg.norm(hole_estimate(states[-1]) - truth) < 1e-3
    first_guess = TASK.body_poses(np.array([spec.nominal for spec in TASK.parameters()]))[BODY].position
    assert np.linalg.norm(first_guess - truth) > 5e-3  # so the images did it


def test_truth_is_in_no_message(three_actions: Any) -> None:
    x, y, _ = hole_truth(three_actions, "start")
    assert abs(x - 0.5) > 1e-6 and abs(y) > 1e-6  # drawn numbers, not design figures
    leaks = {topic for _, topic, m in three_actions.messages if contains(m, x, y)}
    assert not leaks


def test_the_search_for_truth_finds_numbers(three_actions: Any) -> None:
    state = three_actions.on(STATE)[0]
    assert contains(state, float(state.values[0]))
    from std_msgs.msg import String

    assert contains(String(data='{"hole": [0.512345678901, 0]}'), 0.512345678901)
    depth = three_actions.on("/cell/camera/depth/image_rect_raw")[0]
    pixels = np.frombuffer(bytes(depth.data), dtype=np.float32)
    assert contains(depth, float(pixels[np.isfinite(pixels)][0]))
    assert not contains(state, math.pi)


def test_only_listed_topics_are_spoken_on_and_nothing_is_logged_as_error(three_actions: Any) -> None:
    assert {topic for _, topic, _ in three_actions.messages} <= set(TOPICS)
    assert not [entry for entry in three_actions.logs if entry[1] in ("warn", "error")]


@pytest.mark.slow
def test_a_whole_episode_succeeds_and_the_truth_agrees(whole_episode: Any) -> None:
    (outcome,) = whole_episode.on(OUTCOME)
    assert outcome.detected_success, outcome.reason
    assert outcome.reason == "done"
    end = read_truth(whole_episode.truth_file)[0]["end"]
    assert TASK.succeeded(ending_of(end))
    assert np.isfinite(end["peak_contact_force"])
