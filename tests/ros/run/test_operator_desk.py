"""What an operator types reaches the cell once, and only as the answer to what was asked."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from samrl_ros.contract.topics import TOPICS, cell_topic

pytestmark = pytest.mark.ros


@pytest.fixture
def keyboard() -> Iterator[tuple[int, int]]:
    """A descriptor to read from, and one to type into."""
    read, write = os.pipe()
    yield read, write
    for end in (read, write):
        os.close(end)


def test_lines_come_whole_and_at_once(keyboard: tuple[int, int]) -> None:
    from samrl_ros.cell.operator_desk import TypedLines

    lines = TypedLines(keyboard[0])
    assert lines.take() == []
    os.write(keyboard[1], b"y\n\nhal")
    assert lines.take() == ["y", ""]
    os.write(keyboard[1], b"f\n")
    assert lines.take() == ["half"] and not lines.ended


def test_an_enter_from_before_the_question_begins_no_episode(graph: None, keyboard: tuple[int, int]) -> None:
    import rclpy
    from rclpy.experimental.events_executor import EventsExecutor
    from std_msgs.msg import String
    from std_srvs.srv import Trigger

    from samrl_ros.cell.operator_desk import OperatorDesk
    from samrl_ros.contract.qos import qos_named

    told: list[str] = []
    begun: list[int] = []

    def begin(request: Any, response: Any) -> Any:
        begun.append(1)
        response.success, response.message = True, "the episode begins"
        return response

    name = cell_topic("operator/request")
    node, executor = rclpy.create_node("a_bridge"), EventsExecutor()
    executor.add_node(node)
    node.create_service(Trigger, cell_topic("operator/scene_ready"), begin)
    publisher = node.create_publisher(String, name, qos_named(TOPICS[name].qos))
    desk = OperatorDesk(told.append, keyboard[0])

    def spin(until: Callable[[], object], most_s: float) -> None:
        end = time.monotonic() + most_s
        while not until() and time.monotonic() < end:
            desk.spin()
            executor.spin_once(timeout_sec=0.005)

    try:
        os.write(keyboard[1], b"\n\n")  # one too many, before anything is asked
        publisher.publish(String(data=json.dumps({"asks": "scene", "episode": 3, "text": "lay the scene"})))
        spin(lambda: told, 5.0)
        assert desk.waits and "press Enter" in told[0]
        spin(lambda: begun, 0.3)
        assert not begun
        os.write(keyboard[1], b"\n")
        spin(lambda: begun and len(told) > 1, 5.0)
        assert begun == [1] and "the episode begins" in told[1]
    finally:
        desk.close()
        executor.remove_node(node)
        node.destroy_node()
        executor.shutdown()
