"""A node that the middleware does not reach."""

from __future__ import annotations

import pytest

pytest.importorskip("rclpy")
pytestmark = pytest.mark.ros


def test_who_hears_nothing_of_those_who_speak_is_deaf_after_a_minute() -> None:
    from samrl_ros.hosting.deafness import PATIENCE_REPORTS, Deafness

    deafness = Deafness()
    said = [deafness.look(received=0, publishers=2) for _ in range(PATIENCE_REPORTS)]
    assert not any(said[:-1]) and "2 publish joint states" in said[-1] and "start it anew" in said[-1]


@pytest.mark.parametrize(("received", "publishers"), [(1, 2), (0, 0)])
def test_who_heard_once_or_has_nobody_to_hear_is_not(received: int, publishers: int) -> None:
    """A bridge that is held, or not there yet, is no fault of this node."""
    from samrl_ros.hosting.deafness import PATIENCE_REPORTS, Deafness

    deafness = Deafness()
    for _ in range(PATIENCE_REPORTS - 1):
        deafness.look(received=0, publishers=2)
    assert not deafness.look(received, publishers)
    assert not any(deafness.look(0, 2) for _ in range(PATIENCE_REPORTS - 1))


@pytest.mark.live
def test_a_deaf_node_fails(monkeypatch: pytest.MonkeyPatch, ros_domain: int) -> None:
    """Joint states have a publisher that never speaks: to the node it is one that does not reach it."""
    import rclpy
    from sensor_msgs.msg import JointState

    from samrl_ros.contract.qos import qos_named
    from samrl_ros.contract.topics import TOPICS
    from samrl_ros.hosting import deafness
    from samrl_ros.hosting.behaviour_node import BehaviourNode
    from samrl_ros.hosting.cell_node import ACTIVE
    from samrl_ros.hosting.host import start_ros, stop_ros
    from samrl_ros.nodes.supervisor import Supervisor, SupervisorSettings

    monkeypatch.setattr(deafness, "PATIENCE_REPORTS", 2)
    monkeypatch.setattr(Supervisor, "start", lambda self: None)
    name = deafness.SOUNDING[0]
    start_ros([])
    other = rclpy.create_node("other")
    other.create_publisher(JointState, name, qos_named(TOPICS[name].qos))
    node = BehaviourNode(Supervisor, SupervisorSettings, "supervisor")
    try:
        node.trigger_configure()
        node.trigger_activate()
        assert node.stage == ACTIVE
        for _ in range(200):
            node.report()
            rclpy.spin_once(other, timeout_sec=0.02)
            if node.failure:
                break
        assert "joint states" in node.failure and node.stage == ACTIVE
        node.settle()
        assert node.stage != ACTIVE
    finally:
        node.destroy_node()
        other.destroy_node()
        stop_ros()
