"""The generated pages are those that the code gives today, and the table of topics names real nodes."""

from __future__ import annotations

from pathlib import Path

import pytest

from samrl_core.common.errors import SamrlError
from samrl_ros.contract.topics import SERVICES, TOPICS

FOLDER = Path(__file__).resolve().parents[2] / "msgs_docs"
# Speakers that are no nodes of ours: people's tools, and what every node does on its own.
OTHER_PUBLISHERS = {"cell", "any user", "every node"}
HOSTS = {"sim_bridge", "hardware_bridge", "recorder"}


def behaviours() -> set[str]:
    from samrl_ros.hosting.ros_check import require_ros

    try:
        require_ros()
    except SamrlError as error:
        pytest.skip(f"needs ROS: {str(error).splitlines()[0]}")
    from samrl_ros.nodes.registry import behaviour_nodes

    return set(behaviour_nodes())


@pytest.mark.ros
def test_pages_are_current() -> None:
    behaviours()
    from samrl_ros.docs import pages

    made = pages(FOLDER)
    names = {path.name for path in made}
    assert {"topics.md", "parameters.md", "interfaces.md", "effects.md", "cell.yaml"} <= names
    for path, text in made.items():
        assert path.read_text() == text, f"run `make docs` and commit {path.name}"


@pytest.mark.ros
def test_publishers_and_servers_are_nodes() -> None:
    nodes = behaviours() | HOSTS
    assert {topic.publisher for topic in TOPICS.values()} <= nodes | OTHER_PUBLISHERS
    assert {service.server for service in SERVICES} <= nodes


def test_every_topic_says_what_it_is() -> None:
    for topic in TOPICS.values():
        assert topic.name.startswith("/")
        assert topic.type.count("/") == 2
        assert topic.content
        assert "|" not in topic.content  # it would break the table
    assert len({service.name for service in SERVICES}) == len(SERVICES)
