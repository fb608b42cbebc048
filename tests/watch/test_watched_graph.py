"""`samrl diagnose --watch` over DDS: a played bag is the robot, and /diagnostics names its friction."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from samrl_ros.bags.play import publish_from
from samrl_ros.bags.reader import Bag, open_bag
from samrl_ros.recordings import write_recording
from tests.diagnosis.worlds import JOINTS, world
from tests.waiting import wait_for

pytest.importorskip("rclpy")
pytestmark = [pytest.mark.ros, pytest.mark.live]
CLI = [sys.executable, "-m", "samrl_ros.cli.main"]


class Listener:
    """Hears the statuses of one name on /diagnostics."""

    def __init__(self, name: str) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor

        from samrl_ros.contract.message_types import message_class
        from samrl_ros.contract.qos import qos_named
        from samrl_ros.contract.topics import TOPICS

        listed = TOPICS["/diagnostics"]
        self._name, self.newest = name, None
        self.node = rclpy.create_node("listener")
        self.node.create_subscription(
            message_class(listed.type), "/diagnostics", self._take, qos_named(listed.qos)
        )
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)

    def _take(self, message: Any) -> None:
        for status in message.status:
            if status.name == self._name:
                self.newest = status

    def value(self, key: str) -> str:
        self._executor.spin_once(timeout_sec=0.05)
        return "" if self.newest is None else {v.key: v.value for v in self.newest.values}.get(key, "")

    def subscribed(self, node: str, topics: list[str]) -> bool:
        """Whether a node of that name listens to all the topics."""
        return all(
            any(info.node_name == node for info in self.node.get_subscriptions_info_by_topic(topic))
            for topic in topics
        )

    def close(self) -> None:
        self._executor.remove_node(self.node)
        self.node.destroy_node()
        self._executor.shutdown()


@pytest.fixture
def listener() -> Iterator[Listener]:
    from samrl_ros.hosting import start_ros, stop_ros

    start_ros([])
    made = Listener("gap_watch")
    yield made
    made.close()
    stop_ros()


def with_deep_queues(bag: Bag) -> Bag:
    """A busy machine is slow, and loses nothing."""
    topics = (replace(t, qos=tuple(replace(q, depth=10_000) for q in t.qos)) for t in bag.topics)
    return replace(bag, topics=tuple(topics))


@pytest.mark.slow
def test_friction_is_told_on_diagnostics(listener: Listener, tmp_path: Path) -> None:
    (rubbing,) = world(1, "A", coulomb={JOINTS.index("lift"): 0.8})
    bag = write_recording(rubbing, tmp_path / "bag")
    command = [*CLI, "diagnose", "--watch", "--window", "6", "--out", str(tmp_path / "out")]
    with (tmp_path / "log").open("wb") as log:
        process = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT)
    try:
        wait_for(lambda: listener.value("recording"), "the watch")
        played = with_deep_queues(open_bag(bag))
        names = ["/clock", *(topic.name for topic in played.topics)]
        publish_from(listener.node, played, ready=lambda: listener.subscribed("gap_watch", names))
        wait_for(lambda: listener.value("verdict") or listener.value("last not judged"), "an answer")
        assert listener.value("verdict"), listener.value("last not judged")
        assert listener.newest is not None
        assert listener.newest.message == "effect: coulomb_friction@joint:lift"
        assert listener.newest.level == listener.newest.WARN
        assert listener.value("effects") == "coulomb_friction@joint:lift"
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 130
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()
    said = (tmp_path / "log").read_text()
    assert "window 1: effect: coulomb_friction@joint:lift" in said and "interrupted; 1 windows" in said
