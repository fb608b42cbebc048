"""Handlers over a recorded bag: twice gives the same digests, and the same numbers as in the recording."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from samrl_core.common.errors import InputError
from samrl_ros.bags.reader import open_bag
from samrl_ros.contract.topics import FORMER_NAMES, cell_topic
from tests.ros.bag_files import record
from tests.ros.conftest import PLANNED, THREE_ACTIONS

pytest.importorskip("rclpy")
pytestmark = pytest.mark.ros
STATE, ACTION = cell_topic("model_updater/state"), cell_topic("policy/nominal_action")


def makers(*names: str) -> dict[str, Any]:
    """Factories of the nodes, with the settings of the run."""
    from samrl_ros.nodes.registry import entry

    def factory(name: str) -> Any:
        node = entry(name)
        return lambda outbox: node.behaviour(node.settings(**settings.get(name, {})), outbox)

    settings: dict[str, dict[str, Any]] = {"supervisor": THREE_ACTIONS, **PLANNED}
    return {name: factory(name) for name in names}


@pytest.fixture(scope="module")
def bag(three_actions: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("replay") / "bag", three_actions.messages)


@pytest.fixture(scope="module")
def report(bag: Path) -> Any:
    from samrl_ros.cell.replay import replay
    from samrl_ros.cli.cell.replay import COMPARED, DEFAULT_NODES

    return replay(bag, makers(*DEFAULT_NODES), COMPARED)


def test_the_bag_holds_the_run(bag: Path, three_actions: Any) -> None:
    opened = open_bag(bag)
    assert opened.message_count == len(three_actions.messages)
    assert [m.topic for m in opened.messages()] == [topic for _, topic, _ in three_actions.messages]


def test_every_output_is_said_again(report: Any) -> None:
    for topic, row in report.outputs.items():
        assert row["replayed"] == row["recorded"], topic


def test_numbers_are_those_of_the_recording(report: Any) -> None:
    assert report.outputs[STATE]["replayed"] == 5
    for topic in (STATE, ACTION, cell_topic("view_planner/target")):
        assert report.outputs[topic]["largest_difference"] < 1e-9, topic


def test_twice_gives_the_same_digests(bag: Path, report: Any) -> None:
    from samrl_ros.cell.replay import replay
    from samrl_ros.cli.cell.replay import COMPARED, DEFAULT_NODES

    again = replay(bag, makers(*DEFAULT_NODES), COMPARED)
    assert again.outputs == report.outputs
    assert again.digest == report.digest
    assert again.logs == report.logs


def test_a_bag_from_before_the_policy_was_a_node(three_actions: Any, report: Any, tmp_path: Path) -> None:
    """The view planner acted then: every topic has the digest that it has in a bag of today."""
    from samrl_ros.cell.replay import replay
    from samrl_ros.cli.cell.replay import COMPARED, DEFAULT_NODES

    former = {new: old for old, new in FORMER_NAMES.items()}
    messages = [(time_ns, former.get(topic, topic), m) for time_ns, topic, m in three_actions.messages]
    old = replay(record(tmp_path / "bag", messages), makers(*DEFAULT_NODES), COMPARED)
    assert former[ACTION] == cell_topic("view_planner/nominal_action")
    assert old.outputs == {former.get(topic, topic): row for topic, row in report.outputs.items()}
    assert old.outputs[former[ACTION]]["recorded"] == old.outputs[former[ACTION]]["replayed"] == 3


def test_settings_from_before_the_policy_was_a_node(tmp_path: Path) -> None:
    from samrl_ros.cli.cell.replay import recorded_settings

    (tmp_path / "bag").mkdir()
    planner = "{policy: optimised, strategy: best, seed: 4, weights: '', exploration: 0.001, horizon: 2}"
    (tmp_path / "params.yaml").write_text(f"/cell/view_planner: {{ros__parameters: {planner}}}\n")
    found = recorded_settings(tmp_path / "bag")
    assert found["view_planner"] == {"strategy": "best", "seed": 4, "weights": "", "images_kept": 4}
    acting = {"policy": "optimised", "exploration": 0.001, "horizon": 2}
    assert found["policy"] == {"seed": 4, "weights": "", "images_kept": 4, **acting}


def test_another_image_gives_another_digest(three_actions: Any, tmp_path: Path) -> None:
    """The digest covers content: brighter images move the colours that are fitted."""
    from copy import copy

    from samrl_ros.cell.replay import replay

    def brighter(topic: str, message: Any) -> Any:
        if topic != "/cell/camera/color/image_raw":
            return message
        changed = copy(message)
        changed.data = bytes(min(255, value + 20) for value in message.data)
        return changed

    first = next(i for i, (_, topic, m) in enumerate(three_actions.messages) if topic == STATE)
    head = three_actions.messages[: first + 1]
    plain = replay(record(tmp_path / "plain", head), makers("model_updater"))
    changed = [(time_ns, topic, brighter(topic, m)) for time_ns, topic, m in head]
    bright = replay(record(tmp_path / "bright", changed), makers("model_updater"))
    assert plain.outputs[STATE]["replayed"] == bright.outputs[STATE]["replayed"] == 1
    assert plain.digest != bright.digest


def test_a_bag_without_the_needed_topics_is_refused(three_actions: Any, tmp_path: Path) -> None:
    from samrl_ros.cell.replay import replay

    clock_only = [entry for entry in three_actions.messages[:500] if entry[1] in ("/clock", "/tf")]
    assert clock_only
    bag = record(tmp_path / "bag", clock_only)
    with pytest.raises(InputError, match="none of the topics that model_updater hears"):
        replay(bag, makers("model_updater"))


def test_report_is_written_whole(report: Any, tmp_path: Path) -> None:
    import json

    report.write(tmp_path / "report.json")
    data = json.loads((tmp_path / "report.json").read_text())
    assert data["schema"] == 1
    assert data["digest"] == report.digest
