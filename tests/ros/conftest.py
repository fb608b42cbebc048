"""A short run of the whole cell in one thread, made once and looked at by several tests."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture(scope="module")
def graph() -> Iterator[None]:
    """ROS, for the nodes of one module."""
    from samrl_ros.hosting import start_ros, stop_ros

    start_ros([])
    yield
    stop_ros()


@dataclass(frozen=True)
class LocalRun:
    """What a run said, in order, and where evaluation wrote the truth."""

    messages: list[tuple[int, str, Any]]  # simulated time [ns], topic, message
    truth_file: Path
    logs: list[tuple[str, str, str]]

    def on(self, topic: str) -> list[Any]:
        """Messages of one topic."""
        return [message for _, name, message in self.messages if name == topic]


# Plans through the model and looks for information: other actions and views than those of the networks.
THREE_ACTIONS = {"seed": 1, "max_actions": 3, "view_period": 100}  # of the supervisor
PLANNED = {"policy": {"policy": "optimised"}, "view_planner": {"strategy": "best"}}


def run_local_graph(
    folder: Path, supervisor: dict[str, Any], others: dict[str, dict[str, Any]] | None = None
) -> LocalRun:
    """One episode of peg insertion on a `LocalGraph`, by default with the networks of the package."""
    from samrl_ros.cell.local_graph import LocalGraph

    messages: list[tuple[int, str, Any]] = []
    truth_file = folder / "evaluation" / "truth.jsonl"
    graph = LocalGraph("peg_insertion", {"supervisor": supervisor, **(others or {})}, truth_file)
    graph.listener = lambda topic, message: messages.append((graph.bridge.time_ns, topic, message))
    try:
        graph.run()
    finally:
        graph.close()
    return LocalRun(messages, truth_file, graph.logs)


@pytest.fixture(scope="session")
def three_actions(tmp_path_factory: pytest.TempPathFactory) -> LocalRun:
    """Three actions planned through the model, with one search for a view at the start."""
    return run_local_graph(tmp_path_factory.mktemp("three_actions"), THREE_ACTIONS, PLANNED)


@pytest.fixture(scope="session")
def three_learned(tmp_path_factory: pytest.TempPathFactory) -> LocalRun:
    """The same by the networks of the package."""
    return run_local_graph(tmp_path_factory.mktemp("three_learned"), THREE_ACTIONS)


@pytest.fixture(scope="session")
def whole_episode(tmp_path_factory: pytest.TempPathFactory) -> LocalRun:
    """An episode as the cell runs it; minutes of simulated time."""
    return run_local_graph(tmp_path_factory.mktemp("whole_episode"), {"seed": 1})
