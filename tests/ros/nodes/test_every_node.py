"""Every behaviour: its topics are listed, bad messages are refused in words, settings have limits."""

from __future__ import annotations

import dataclasses
import json
from array import array
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.robots.robot import ROLES
from samrl_core.cell.tasks import task_named
from samrl_core.common.errors import InputError, SamrlError
from samrl_ros.contract.topics import TOPICS, arm_topic, cell_topic

pytest.importorskip("rclpy")
pytestmark = pytest.mark.ros
NODES = ("manipulator", "view_planner", "policy", "model_updater", "residual_trainer", "supervisor")
READY, REQUEST = cell_topic("sim_bridge/ready"), cell_topic("supervisor/request")


class Ears:
    """An outbox that remembers."""

    def __init__(self) -> None:
        self.said: list[tuple[str, Any]] = []
        self.logs: list[tuple[str, str]] = []

    def publish(self, topic: str, message: Any) -> None:
        self.said.append((topic, message))

    def log(self, level: str, text: str) -> None:
        self.logs.append((level, text))

    def call(self, service: str, request: Any, on_response: Callable[[Any], None]) -> None:
        self.said.append((service, request))


def entry(name: str) -> Any:
    from samrl_ros.nodes.registry import behaviour_nodes

    return behaviour_nodes()[name]


def message(topic: str) -> Any:
    """A new message of the topic's type, as its constructor leaves it."""
    from samrl_ros.contract.message_types import message_class

    return message_class(TOPICS[topic].type)()


def joint_state(role: str, stamp_ns: int) -> Any:
    from samrl_core.cell.types.observation import ArmReading
    from samrl_ros.conversions import to_message

    position = task_named("peg_insertion").start_joints(cell_named())[role]
    zeros = np.zeros(position.size)
    names = cell_named().arm(role).joint_names
    return to_message.joint_state(ArmReading(stamp_ns, position, zeros, zeros), names)


def fill(value: Any, number: float, text: str) -> Any:
    """Every number, list and text of a message made senseless, in place."""
    for name, kind in value.get_fields_and_field_types().items():
        present = getattr(value, name)
        if name == "header":
            continue
        if hasattr(present, "get_fields_and_field_types"):
            fill(present, number, text)
        elif isinstance(present, bool):
            setattr(value, name, True)
        elif isinstance(present, float):
            setattr(value, name, number)
        elif isinstance(present, str):
            setattr(value, name, text)
        elif isinstance(present, np.ndarray):
            present[:] = number
        elif kind in ("sequence<double>", "sequence<float>"):
            setattr(value, name, array("d" if "double" in kind else "f", [number] * 3))
        elif kind == "sequence<string>":
            setattr(value, name, [text] * 3)
    return value


def bad_messages(topic: str) -> Iterator[Any]:
    """Empty, not finite, and senseless ones."""
    yield message(topic)
    yield fill(message(topic), float("nan"), "")
    yield fill(message(topic), 1e300, "no such thing")
    if TOPICS[topic].type == "std_msgs/msg/String":
        for text in ("null", "[]", "{}", '"x"', '{"version": "new"}', '{"version": [1]}', '{"version": 7}'):
            yield fill(message(topic), 0.0, text)
        for broken in ({"position": []}, {"position": "abc", "quat_xyzw": [0, 0, 0, 1]}, 3, [1, 2]):
            bases = dict.fromkeys(ROLES, broken)
            yield fill(message(topic), 0.0, json.dumps({"camera_in_flange": broken, "base_in_world": bases}))


def woken(name: str) -> tuple[Any, Ears]:
    """A started behaviour in the middle of an episode, so that no input is merely waited away."""
    ears = Ears()
    behaviour = entry(name).behaviour(entry(name).settings(), ears)
    if name != "view_planner":  # its start works out reachable views for seconds; none is asked for here
        behaviour.start()
    inputs = set(behaviour.inputs)
    for role in ROLES:
        if arm_topic(role, "joint_states") in inputs:
            behaviour.handle(arm_topic(role, "joint_states"), joint_state(role, 0))
    if READY in inputs:
        ready = message(READY)
        ready.task = "peg_insertion"
        behaviour.handle(READY, ready)
    if REQUEST in inputs:
        request = message(REQUEST)
        request.stage = {"view_planner": "view", "policy": "act", "model_updater": "update"}[name]
        behaviour.handle(REQUEST, request)
    return behaviour, ears


def pairs() -> list[tuple[str, str]]:
    try:
        return [(name, topic) for name in NODES for topic in sorted(entry(name).behaviour.inputs)]
    except ImportError:  # without ROS there is nothing to feed
        return []


def test_the_list_of_nodes_is_complete() -> None:
    from samrl_ros.nodes.registry import behaviour_nodes

    assert set(behaviour_nodes()) == set(NODES)
    with pytest.raises(InputError, match="no node 'cook'"):
        __import__("samrl_ros.nodes.registry", fromlist=["entry"]).entry("cook")


@pytest.mark.parametrize("name", NODES)
def test_topics_are_listed_and_belong_to_the_node(name: str) -> None:
    behaviour = entry(name).behaviour
    assert behaviour.name == name
    assert behaviour.inputs and behaviour.outputs
    assert set(behaviour.inputs) <= set(TOPICS)
    assert {TOPICS[topic].publisher for topic in behaviour.outputs} == {name}
    assert not set(behaviour.inputs) & set(behaviour.outputs)


def test_every_listed_topic_of_a_behaviour_has_its_speaker() -> None:
    said = {topic for name in NODES for topic in entry(name).behaviour.outputs}
    assert {t.name for t in TOPICS.values() if t.publisher in NODES} == said


@pytest.mark.parametrize(("name", "topic"), pairs())
def test_a_bad_message_is_refused_in_words_or_ignored(name: str, topic: str) -> None:
    for bad in bad_messages(topic):
        behaviour, ears = woken(name)
        try:
            behaviour.handle(topic, bad)
        except SamrlError as error:
            assert len(str(error)) > 20
        for said, value in ears.said:
            if said in TOPICS:
                assert said in behaviour.outputs
            if said.endswith("/command"):
                assert np.isfinite(value.points[0].positions).all()
        assert all(isinstance(text, str) for text in behaviour.status().values())


@pytest.mark.parametrize("name", NODES)
def test_settings_out_of_range_are_refused(name: str) -> None:
    from samrl_ros.hosting.parameters import why_refused

    for field in dataclasses.fields(entry(name).settings):
        assert field.metadata["description"]
        assert why_refused(field, field.default) == ""
        if field.metadata["range"]:
            low, high = field.metadata["range"]
            assert why_refused(field, low) == why_refused(field, high) == ""
            for value in (low - 1, high + 1, float("nan")):
                assert field.name in why_refused(field, value)
        if field.metadata["choices"]:
            assert "none of" in why_refused(field, "no such choice")


@pytest.mark.parametrize("name", NODES)
def test_an_unknown_task_is_refused(name: str) -> None:
    if name == "residual_trainer":
        pytest.skip("holds no scene: the task is a label to it")
    with pytest.raises(InputError, match="juggling"):
        entry(name).behaviour(entry(name).settings(task="juggling"), Ears())
