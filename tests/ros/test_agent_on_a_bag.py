"""Algorithm 1 in the library and in the node graph: on a recorded bag both choose the same actions."""

from __future__ import annotations

import json
import tracemalloc
from collections.abc import Callable, Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.observation import Observation
from samrl_core.common.errors import InputError
from samrl_core.model.model import Model
from samrl_core.policy.agent.agent import Agent
from samrl_core.policy.agent.episode import run_episode
from samrl_core.policy.agent.loop import LoopSettings
from samrl_core.policy.agent.settings import AgentSettings, trained_networks
from samrl_core.policy.networks.networks import ResidualActor, SensingQ, SimActor
from samrl_core.policy.networks.weights import WeightsInfo, save_weights, sha256_of
from samrl_ros.bags.reader import open_bag
from samrl_ros.cell.visited_states import visited_in_bag
from samrl_ros.contract.topics import arm_topic, cell_topic
from samrl_ros.conversions import from_message
from samrl_ros.nodes import assembly
from tests.ros.bag_files import record

pytest.importorskip("rclpy")
pytestmark = pytest.mark.ros
TASK, CELL = task_named("peg_insertion"), cell_named()
REQUEST, STATE = cell_topic("supervisor/request"), cell_topic("model_updater/state")
TARGET, ACTION = cell_topic("view_planner/target"), cell_topic("policy/nominal_action")
WEIGHTS = cell_topic("residual_trainer/weights")


def messages_of(bag: Path) -> Iterator[tuple[str, Any]]:
    """Topics and messages in recorded order."""
    from rclpy.serialization import deserialize_message

    from samrl_ros.contract.message_types import message_class

    opened = open_bag(bag)
    classes = {t.name: message_class(t.type) for t in opened.topics}
    for item in opened.messages():
        yield item.topic, deserialize_message(item.data, classes[item.topic])


@pytest.fixture(scope="module")
def recorded(three_actions: Any, tmp_path_factory: pytest.TempPathFactory) -> list[tuple[str, Any]]:
    """A run of three actions, read back from its bag."""
    bag = record(tmp_path_factory.mktemp("agent") / "bag", three_actions.messages)
    return list(messages_of(bag))


@pytest.fixture(scope="module")
def observations(recorded: list[tuple[str, Any]]) -> dict[int, Observation]:
    """Of that run."""
    return seen_in(recorded)


def seen_in(recorded: list[tuple[str, Any]]) -> dict[int, Observation]:
    """All that the cell saw, by stamp."""
    assembler = assembly.Assembler(CELL)
    found = {}
    for topic, message in recorded:
        observation = assembler.take(topic, message) if topic in assembly.INPUTS else None
        if observation is not None:
            found[observation.stamp_ns] = observation
    return found


class BagPlant:
    """Shows the images that the graph used, and notes what it is told to do."""

    def __init__(self, recorded: list[tuple[str, Any]], observations: dict[int, Observation]) -> None:
        stamps = [from_message.stamp_ns(m) for topic, m in recorded if topic == STATE]
        self._seen = iter([observations[stamp] for stamp in stamps])
        self.told: list[tuple[str, np.ndarray]] = []

    def observe(self) -> Observation:
        return next(self._seen)

    def move_camera(self, camera_arm_position: np.ndarray) -> None:
        self.told.append((TARGET, camera_arm_position))

    def displace_tool(self, displacement: np.ndarray) -> None:
        self.told.append((ACTION, displacement))


def said(topic: str, message: Any) -> tuple[str, np.ndarray]:
    """What a target or an action tells the arms to do."""
    if topic == TARGET:
        return topic, np.array(message.joint_position)
    return topic, from_message.vector(message.nominal) + from_message.vector(message.residual)


def assert_same(found: list[tuple[str, np.ndarray]], expected: list[tuple[str, np.ndarray]]) -> None:
    assert [topic for topic, _ in found] == [topic for topic, _ in expected]
    for (_, one), (_, other) in zip(found, expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-12)


def test_the_library_does_what_the_graph_did(
    recorded: list[tuple[str, Any]], observations: dict[int, Observation]
) -> None:
    """From the images alone: updates, the move of the camera, three actions, and the end."""
    planned = AgentSettings(policy="optimised", strategy="best")
    told = compare(recorded, observations, Agent(Model(TASK, CELL), planned))
    assert [topic for topic, _ in told] == [TARGET, ACTION, ACTION, ACTION]


@pytest.mark.thorough
def test_so_it_does_with_the_networks_of_the_package(
    three_learned: Any, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """What the cell does unless it is told otherwise; whether the camera moves is the networks' affair."""
    recorded = list(messages_of(record(tmp_path_factory.mktemp("learned") / "bag", three_learned.messages)))
    agent = Agent(Model(TASK, CELL), AgentSettings(), trained_networks(TASK.name, CELL))
    told = compare(recorded, seen_in(recorded), agent)
    assert [topic for topic, _ in told if topic == ACTION] == 3 * [ACTION]


def compare(
    recorded: list[tuple[str, Any]], observations: dict[int, Observation], agent: Agent
) -> list[tuple[str, np.ndarray]]:
    """Holds the library against a run of three actions; what the arms were told."""
    told = [said(topic, m) for topic, m in recorded if topic == ACTION or (topic == TARGET and m.move)]
    plant = BagPlant(recorded, observations)
    episode = run_episode(agent, plant, LoopSettings(max_actions=3, view_period=100))
    assert episode.ended == "action_limit"
    assert_same(plant.told, told)
    last = [m for topic, m in recorded if topic == STATE][-1]
    np.testing.assert_allclose(episode.estimate.values, last.values, rtol=0, atol=1e-12)
    return told


def test_the_bag_keeps_what_was_visited(
    three_actions: Any, recorded: list[tuple[str, Any]], observations: dict[int, Observation], tmp_path: Path
) -> None:
    """Line 16 of Algorithm 1: the last estimate before each action, with the tip of its image."""
    bag = record(tmp_path / "bag", three_actions.messages)
    found = visited_in_bag(bag, TASK, CELL)
    assert found.step.tolist() == [0, 1, 2, 3] and len(set(found.episode)) == 1
    states = {int(m.step): m for topic, m in recorded if topic == STATE}
    model = Model(TASK, CELL)
    for row, step in enumerate(found.step):
        message = states[int(step)]
        np.testing.assert_array_equal(found.values[row], message.values)
        seen = observations[from_message.stamp_ns(message)]
        tip = model.tip_in_base(seen.tool_arm.position).position
        np.testing.assert_allclose(found.tip_in_base[row], tip, atol=1e-12)
    assert len(found.starts(TASK).values) == 4
    with pytest.raises(InputError, match="states of peg_insertion"):
        visited_in_bag(bag, task_named("needle_threading"), CELL)


def test_what_was_visited_takes_no_memory_for_the_length_of_a_run(three_actions: Any, tmp_path: Path) -> None:
    """12 s more of joint states, nothing else. Kept as objects they take 4 MB, and an hour of them 1 GB."""
    joints = arm_topic("tool_arm", "joint_states")
    end, message = max(
        ((t, m) for t, topic, m in three_actions.messages if topic == joints), key=lambda one: one[0]
    )
    rest = []
    for k in range(1, 3001):
        later = deepcopy(message)
        later.header.stamp.sec, later.header.stamp.nanosec = divmod(end + k * 4_000_000, 10**9)
        rest.append((end + k * 4_000_000, joints, later))
    bags = [
        record(tmp_path / "short", three_actions.messages),
        record(tmp_path / "long", [*three_actions.messages, *rest]),
    ]
    visited_in_bag(bags[0], TASK, CELL)  # what is made once is made
    peaks = []
    for bag in bags:
        tracemalloc.start()
        visited_in_bag(bag, TASK, CELL)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] - peaks[0] < 500_000


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Networks that were never trained, and a residual past its zero start."""
    folder = tmp_path_factory.mktemp("weights")
    generator = torch.Generator().manual_seed(8)
    residual = ResidualActor(0.002, generator)
    last = residual.head[-1]
    assert isinstance(last, torch.nn.Linear)
    torch.nn.init.normal_(last.weight, std=0.2, generator=generator)
    for kind, module, limit in (
        ("sim_actor", SimActor(0.005, generator), 0.005),
        ("sensing_q", SensingQ(generator), 0.005),
        ("residual_actor", residual, 0.002),
    ):
        about = WeightsInfo(kind, TASK.name, CELL.intrinsics, limit, 0)
        save_weights(folder / f"{TASK.name}_{kind}.safetensors", module, about)
    return folder


def announcement(folder: Path, **changes: Any) -> Any:
    """The trainer's message of the residual in the folder."""
    from std_msgs.msg import String

    file = folder / f"{TASK.name}_residual_actor.safetensors"
    data = {"task": TASK.name, "version": 1, "file": str(file), "sha256": sha256_of(file), **changes}
    return String(data=json.dumps(data))


def learned_planner(folder: Path) -> tuple[Any, Any]:
    """The view planner as a cell with trained weights runs it, and what it says."""
    from samrl_ros.cell.replay import RecordingOutbox
    from samrl_ros.nodes.view_planner import ViewPlannerNode, ViewPlannerSettings

    outbox = RecordingOutbox(keep=frozenset({TARGET}))
    return ViewPlannerNode(ViewPlannerSettings(strategy="q", weights=str(folder)), outbox), outbox


def learned_policy(folder: Path) -> tuple[Any, Any]:
    """The policy as a cell with trained weights runs it, and what it says."""
    from samrl_ros.cell.replay import RecordingOutbox
    from samrl_ros.nodes.policy import PolicyNode, PolicySettings

    outbox = RecordingOutbox(keep=frozenset({ACTION}))
    return PolicyNode(PolicySettings(policy="learned", weights=str(folder)), outbox), outbox


@pytest.mark.thorough
def test_learned_parts_are_the_same_in_both(
    recorded: list[tuple[str, Any]], observations: dict[int, Observation], weights: Path
) -> None:
    """Actor, Q and residual, on the recorded states and images."""
    (planner, views), (policy, actions) = learned_planner(weights), learned_policy(weights)
    for node in (planner, policy):
        node.start()
        for topic, message in recorded:
            if topic in node.inputs:
                node.handle(topic, announcement(weights) if topic == WEIGHTS else message)
    found = [said(TARGET, m) for m in views.kept[TARGET]] + [said(ACTION, m) for m in actions.kept[ACTION]]

    from samrl_ros.conversions.model_state import from_state

    model, networks = Model(TASK, CELL), trained_networks(TASK.name, CELL, weights)
    settings = AgentSettings(policy="learned", strategy="q")
    agent = Agent(model, settings, networks)
    agent.residual = policy._agent.residual
    assert agent.residual is not None
    choose: dict[str, Callable[[Any, Observation], np.ndarray]] = {
        "view": lambda state, seen: agent.plan_view(state, seen).joint_position,
        "act": lambda state, seen: agent.act(state, seen).displacement,
    }
    expected: dict[str, list[np.ndarray]] = {"view": [], "act": []}
    state: Any = None
    for topic, message in recorded:
        if topic == STATE:
            state = from_state(message)
        elif topic == REQUEST and message.stage in choose:
            expected[message.stage].append(choose[message.stage](state, observations[state.stamp_ns]))
    assert len(expected["view"]) == 1 and len(expected["act"]) == 3
    assert_same(found, [(TARGET, v) for v in expected["view"]] + [(ACTION, a) for a in expected["act"]])
    assert all(np.linalg.norm(from_message.vector(m.residual)) > 1e-6 for m in actions.kept[ACTION])
    assert policy.status()["residual_version"] == "1"


def test_a_residual_that_is_not_as_announced_is_refused(weights: Path, tmp_path: Path) -> None:
    """Another content, another task, no file, no path; zero is always taken."""
    node, _ = learned_policy(weights)
    for changes, words in (
        ({"sha256": "0" * 64}, "nothing of it is used"),
        ({"task": "needle_threading"}, "one task"),
        ({"file": str(tmp_path / "none")}, "no residual weights"),
        ({"file": "residual.safetensors"}, "absolute"),
        ({"version": True}, "see msgs_docs"),
        ({"version": -1}, "see msgs_docs"),
    ):
        with pytest.raises(InputError, match=words):
            node.handle(WEIGHTS, announcement(weights, **changes))
    node.handle(WEIGHTS, announcement(weights))
    assert node.status()["residual_version"] == "1"
    node.handle(WEIGHTS, announcement(weights, version=0, file="", sha256=""))
    assert node.status()["residual_version"] == "0"


def test_a_lost_image_is_replaced_by_the_next(recorded: list[tuple[str, Any]], weights: Path) -> None:
    """Images are sent without acknowledgement; an action waits for one rather than act blindly."""
    from samrl_ros.contract.topics import camera_topic

    node, outbox = learned_policy(weights)
    first = next(m for topic, m in recorded if topic == STATE)
    lost = from_message.stamp_ns(first)
    acts = [i for i, (topic, m) in enumerate(recorded) if topic == REQUEST and m.stage == "act"]
    for topic, message in recorded[: acts[0]]:
        if topic in node.inputs and topic not in (REQUEST, WEIGHTS):
            if topic != camera_topic("color/image_raw"):  # none arrives
                node.handle(topic, message)
    request = deepcopy(recorded[acts[0]][1])
    node.handle(REQUEST, request)
    assert not outbox.kept[ACTION]
    for topic, message in recorded[acts[0] :]:
        if topic in node.inputs and topic not in (REQUEST, WEIGHTS, STATE):
            node.handle(topic, message)
    (action,) = outbox.kept[ACTION]
    assert from_message.stamp_ns(action) >= from_message.stamp_ns(request) > lost
