"""Recorder and player on a live graph."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from copy import copy
from pathlib import Path
from typing import Any

import pytest

from samrl_core.common.errors import InputError, LimitError
from samrl_ros.bags.play import clock_bytes, publish_from
from samrl_ros.bags.qos_metadata import QoS
from samrl_ros.bags.reader import open_bag
from samrl_ros.bags.writer import BagWriter
from tests.waiting import PATIENCE_S, wait_for

pytestmark = [pytest.mark.ros, pytest.mark.live]
STRING = "std_msgs/msg/String"
JOINTS = "sensor_msgs/msg/JointState"
TOOL, PHASE, STATES = "/cell/tool_arm/tool", "/cell/phase", "/cell/tool_arm/joint_states"
RECORDED = [TOOL, PHASE, STATES]


@pytest.fixture
def node(graph: None) -> Iterator[Any]:
    import rclpy

    node = rclpy.create_node("tester")
    yield node
    node.destroy_node()


@pytest.fixture
def record(graph: None) -> Iterator[Callable[..., Any]]:
    from rclpy.parameter import Parameter

    from samrl_ros.hosting import NodeThread
    from samrl_ros.nodes.recorder_node import RecorderNode

    threads = []

    def make(out: Path, sim_time: bool = True, **more: Any) -> Any:
        values = {"out": str(out), "topics": RECORDED, "use_sim_time": sim_time, "task": "t", **more}
        node = RecorderNode(parameter_overrides=[Parameter(n, value=v) for n, v in values.items()])
        threads.append(NodeThread(node))
        threads[-1].start()
        return threads[-1]

    yield make
    for thread in threads:
        thread.stop()


class Speaker:
    """Publishes raw bytes and waits until the recorder listens."""

    def __init__(self, node: Any) -> None:
        from samrl_ros.contract.message_types import message_class
        from samrl_ros.contract.qos import qos_named
        from samrl_ros.contract.topics import TOPICS

        self._publishers = {
            name: node.create_publisher(message_class(TOPICS[name].type), name, qos_named(TOPICS[name].qos))
            for name in (*RECORDED, "/clock")
        }

    def ready(self) -> None:
        wait_for(
            lambda: all(p.get_subscription_count() > 0 for p in self._publishers.values()), "the other side"
        )

    def say(self, topic: str, data: bytes) -> None:
        self._publishers[topic].publish(data)


def _phases(folder: Path) -> list[str]:
    """Phases that are on disk so far."""
    try:
        return [m.data for _, m in open_bag(folder).decoded([PHASE])]
    except InputError:  # not there yet, or its first chunk is not
        return []


def count(thread: Any, topic: str, number: int) -> Callable[[], bool]:
    return lambda: thread.node.health.topics[topic].received >= number


def test_record_with_simulated_time(record, node, tmp_path: Path, string_cdr, joints_cdr) -> None:
    speaker = Speaker(node)
    speaker.say(TOOL, string_cdr("{}"))  # before the recorder exists: latched
    thread = record(tmp_path / "bag")
    speaker.ready()
    wait_for(count(thread, TOOL, 1), "messages at the recorder")
    for i in range(1, 21):
        speaker.say("/clock", clock_bytes(i * 4_000_000))
        wait_for(count(thread, "/clock", i), "messages at the recorder")
        speaker.say(STATES, joints_cdr(i * 4_000_000 + 1, 0.1 * i))
        wait_for(count(thread, STATES, i), "messages at the recorder")
    thread.stop()
    assert not thread.failure
    bag = open_bag(tmp_path / "bag")
    assert bag.has_metadata and not bag.truncated and bag.custom_data["task"] == "t"
    states = [(r.log_time_ns, r.publish_time_ns) for r, _ in bag.decoded([STATES])]
    assert states == [(i * 4_000_000, i * 4_000_000 + 1) for i in range(1, 21)]
    assert [(r.log_time_ns, m.data) for r, m in bag.decoded([TOOL])] == [(4_000_000, "{}")]
    raw = next(bag.messages([STATES]))
    assert raw.data == joints_cdr(4_000_001, 0.1)  # the wire's bytes, nothing added
    assert bag.topic(TOOL).qos == (QoS(durability="transient_local", depth=1),)


def test_services_start_stop_split(record, node, tmp_path: Path, string_cdr) -> None:
    from rclpy.executors import SingleThreadedExecutor
    from std_srvs.srv import Trigger

    speaker = Speaker(node)
    thread = record(tmp_path / "bag", record_on_start=False)
    clients = {n: node.create_client(Trigger, f"/cell/recorder/{n}") for n in ("start", "stop", "split")}
    executor = SingleThreadedExecutor()
    executor.add_node(node)

    def call(name: str) -> Any:
        assert clients[name].wait_for_service(PATIENCE_S)
        future = clients[name].call_async(Trigger.Request())
        executor.spin_until_future_complete(future, timeout_sec=PATIENCE_S)
        return future.result()

    assert not call("stop").success and not call("split").success
    speaker.ready()
    speaker.say("/clock", clock_bytes(5))
    speaker.say(TOOL, string_cdr("{}"))
    wait_for(count(thread, TOOL, 1), "messages at the recorder")
    wait_for(count(thread, "/clock", 1), "messages at the recorder")
    assert call("start").success
    assert not call("start").success
    speaker.say(PHASE, string_cdr("a"))
    wait_for(count(thread, PHASE, 1), "messages at the recorder")
    assert call("split").message.endswith("bag_1.mcap")
    speaker.say(PHASE, string_cdr("b"))
    wait_for(count(thread, PHASE, 2), "messages at the recorder")
    assert "bag: 3 messages" in call("stop").message  # the latched one is in it too
    assert call("start").message == str(tmp_path / "bag_1")
    assert call("stop").success
    assert [m.data for _, m in open_bag(tmp_path / "bag").decoded()] == ["{}", "a", "b"]
    assert [m.data for _, m in open_bag(tmp_path / "bag_1").decoded()] == ["{}"]


def test_folder_in_use_fails_the_node_and_keeps_the_folder(record, tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    thread = record(tmp_path / "bag")
    wait_for(lambda: thread.failure, "the other side")
    assert "exists already" in thread.failure
    assert list((tmp_path / "bag").iterdir()) == []


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_recorder_process_ended_by_a_signal(
    node, tmp_path: Path, string_cdr, child_environment, number
) -> None:
    arguments = ["--ros-args", "-p", f"out:={tmp_path / 'bag'}", "-p", "use_sim_time:=true"]
    command = "import sys; from samrl_ros.nodes.recorder_node import main; sys.exit(main(sys.argv))"
    child = subprocess.Popen(
        [sys.executable, "-c", command, *arguments, "-p", f"topics:=[{','.join(RECORDED)}]"],
        env={**os.environ, **child_environment},
    )
    try:
        speaker = Speaker(node)
        speaker.ready()
        wait_for((tmp_path / "bag").exists, "the other side")
        for i in range(1, 60):
            speaker.say("/clock", clock_bytes(i * 4_000_000))
            speaker.say(PHASE, string_cdr(str(i)))
            time.sleep(0.012)
        if number == signal.SIGKILL:  # what arrived must not wait for the next message to reach the disk
            wait_for(lambda: "59" in _phases(tmp_path / "bag"), "the last phase on disk", 0.1)
    finally:
        child.send_signal(number)
        code = child.wait(PATIENCE_S)
    assert code == (0 if number == signal.SIGTERM else -number)
    bag = open_bag(tmp_path / "bag")
    assert bag.truncated == (number == signal.SIGKILL)
    assert [m.data for _, m in bag.decoded([PHASE])][-1] == "59"


def test_play_over_dds(node, tmp_path: Path, string_cdr, joints_cdr) -> None:
    import rclpy
    from rclpy.executors import SingleThreadedExecutor

    from samrl_ros.contract.message_types import message_class
    from samrl_ros.contract.qos import qos_named
    from samrl_ros.contract.topics import TOPICS

    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic(TOOL, STRING, QoS(durability="transient_local", depth=1))
        writer.add_topic(STATES, JOINTS, QoS(depth=100))  # a busy computer loses none
        writer.add_topic("/clock", "rosgraph_msgs/msg/Clock", QoS(reliability="best_effort", depth=1))
        for i in range(50):
            now = 10_000_000_000 + i * 20_000_000
            writer.write(STATES, now, joints_cdr(now, float(i)))
            writer.write("/clock", now, clock_bytes(now))
        writer.write(TOOL, 10_500_000_000, string_cdr("{}"))
    listener = rclpy.create_node("listener")
    heard: list[tuple[str, bytes]] = []
    for name in (TOOL, STATES, "/clock"):
        kind = message_class(TOPICS[name].type)
        take = lambda data, name=name: heard.append((name, data))  # noqa: E731
        qos = copy(qos_named(TOPICS[name].qos))
        qos.depth = 100
        listener.create_subscription(kind, name, take, qos, raw=True)
    executor = SingleThreadedExecutor()
    executor.add_node(listener)
    stop = threading.Event()

    def spin() -> None:
        while not stop.is_set():
            executor.spin_once(timeout_sec=0.02)

    thread = threading.Thread(target=spin)
    thread.start()
    progress = []
    try:
        bag = open_bag(tmp_path / "bag")
        began = time.monotonic()
        report = publish_from(node, bag, 4.0, discovery_s=1.0, on_progress=lambda *p: progress.append(p))
        took = time.monotonic() - began - 1.0
        wait_for(lambda: sum(name == STATES for name, _ in heard) == 50, "the other side")
        ended = threading.Event()
        ended.set()
        assert publish_from(node, bag, stop=ended, discovery_s=0.0).stopped
    finally:
        stop.set()
        thread.join()
        listener.destroy_node()
    assert report.published == {TOOL: 1, STATES: 50} and not report.stopped
    assert took > 0.98 / 4 - 0.05  # never faster than the rate asks; a busy machine may be slower
    assert progress[-1] == (51, 51)
    assert heard[0] == (TOOL, string_cdr("{}"))  # the description comes first
    states = [data for name, data in heard if name == STATES]
    assert states == [m.data for m in bag.messages([STATES])]
    clocks = [data for name, data in heard if name == "/clock"]
    assert clocks == sorted(set(clocks), key=clocks.index)  # the recorded clock is not doubled


def test_play_refuses_bad_rates_and_unknown_types(node, tmp_path: Path, small_bag) -> None:
    bag = open_bag(small_bag())
    for rate in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(LimitError, match="rate"):
            publish_from(node, bag, rate)
    with pytest.raises(InputError, match="/nope"):
        publish_from(node, bag, topics=["/nope"])


# All imports come before "up": an interrupt in the middle of one may be swallowed by it.
PLAY = """
import sys
import rclpy, rich.console, rich.progress, rosgraph_msgs.msg
import samrl_ros.hosting.host
from samrl_ros.bags.play import publish
from samrl_ros.bags.reader import open_bag
print("up", flush=True)
try:
    publish(open_bag(sys.argv[1]), 0.001)
except KeyboardInterrupt:
    sys.exit(130)
"""


def test_ctrl_c_ends_the_player(small_bag, child_environment) -> None:
    child = subprocess.Popen(
        [sys.executable, "-c", PLAY, str(small_bag())],
        env={**os.environ, **child_environment},
        stdout=subprocess.PIPE,
        text=True,
    )
    assert child.stdout is not None
    assert child.stdout.readline() == "up\n"
    time.sleep(1.0)
    child.send_signal(signal.SIGINT)
    child.stdout.close()
    assert child.wait(PATIENCE_S) == 130
