"""`samrl diagnose --watch` over DDS: a played bag is the robot, and /diagnostics names its friction."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

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
        self._node = rclpy.create_node("listener")
        self._node.create_subscription(
            message_class(listed.type), "/diagnostics", self._take, qos_named(listed.qos)
        )
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)

    def _take(self, message: Any) -> None:
        for status in message.status:
            if status.name == self._name:
                self.newest = status

    def value(self, key: str) -> str:
        self._executor.spin_once(timeout_sec=0.05)
        return "" if self.newest is None else {v.key: v.value for v in self.newest.values}.get(key, "")

    def close(self) -> None:
        self._executor.remove_node(self._node)
        self._node.destroy_node()
        self._executor.shutdown()


@pytest.fixture
def listener() -> Iterator[Listener]:
    from samrl_ros.hosting import start_ros, stop_ros

    start_ros([])
    made = Listener("gap_watch")
    yield made
    made.close()
    stop_ros()


def test_friction_is_told_on_diagnostics(listener: Listener, tmp_path: Path) -> None:
    (rubbing,) = world(1, "A", coulomb={JOINTS.index("lift"): 0.8})
    bag = write_recording(rubbing, tmp_path / "bag")
    log = (tmp_path / "log").open("wb")
    command = [*CLI, "diagnose", "--watch", "--window", "6", "--out", str(tmp_path / "out")]
    process = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT)
    player = None
    try:
        wait_for(lambda: listener.value("recording"), "the watch")
        player = subprocess.Popen([*CLI, "replay", str(bag), "--publish"], stdout=log, stderr=log)
        wait_for(lambda: listener.value("verdict"), "a diagnosis")
        assert listener.newest is not None
        assert listener.newest.message == "effect: coulomb_friction@joint:lift"
        assert listener.newest.level == listener.newest.WARN
        assert listener.value("effects") == "coulomb_friction@joint:lift"
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 130
    finally:
        for each in (process, player):
            if each is not None and each.poll() is None:
                each.kill()
                each.wait()
    said = (tmp_path / "log").read_text()
    assert "window 1: effect: coulomb_friction@joint:lift" in said and "interrupted; 1 windows" in said
