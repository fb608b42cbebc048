"""An emergency stop holds the episode, a reset lets it go on, and nothing moves by what came before."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_ros.contract.topics import arm_topic, cell_topic
from tests.ros.bag_files import record

pytest.importorskip("rclpy")
pytestmark = pytest.mark.ros
ACTION, EXECUTED = cell_topic("policy/nominal_action"), cell_topic("manipulator/executed_action")
OUTCOME, PHASE, SAFETY = cell_topic("supervisor/outcome"), cell_topic("phase"), cell_topic("safety_state")
READY = cell_topic("sim_bridge/ready")
STATUS, CLOCK = arm_topic("tool_arm", "motion_status"), "/clock"
JOINTS, SECOND = arm_topic("tool_arm", "joint_states"), 1_000_000_000
IN_MOTION_NS, STANDS_NS = 120_000_000, SECOND  # after the action was asked for; from stop to reset


class StoppedRun:
    """Episodes of as many actions each; the arms are stopped after the first one's last was asked for."""

    def __init__(
        self,
        folder: Path,
        while_stopped: Callable[[StoppedRun], None] = lambda run: None,
        after_ns: int = IN_MOTION_NS,
        episodes: int = 2,
        actions: int = 2,
    ) -> None:
        from samrl_ros.cell.local_graph import LocalGraph

        self.messages: list[tuple[int, str, Any]] = []
        self.settings = {"seed": 1, "episodes": episodes, "max_actions": actions, "view_period": 100}
        self._last_step = actions - 1
        self.graph = LocalGraph("peg_insertion", {"supervisor": self.settings}, folder / "truth.jsonl")
        self.graph.listener = self._hear
        self._while_stopped, self._after_ns = while_stopped, after_ns
        self._asked_ns = self.stopped_ns = self.reset_ns = 0
        self.refusals: list[str] = []
        try:
            self.graph.run()
        finally:
            self.graph.close()

    def _hear(self, topic: str, message: Any) -> None:
        now = self.graph.bridge.time_ns
        self.messages.append((now, topic, message))
        if topic == ACTION and not self._asked_ns and (message.episode, message.step) == (0, self._last_step):
            self._asked_ns = now
        if topic != CLOCK or not self._asked_ns:
            return
        if not self.stopped_ns and now - self._asked_ns >= self._after_ns:
            self.stopped_ns = now
            self.graph.bridge.guards.estop("asked for")
            self.refusals.append(self.graph.bridge.reset_safety())
        elif self.stopped_ns and not self.reset_ns and now - self.stopped_ns >= STANDS_NS:
            self._while_stopped(self)
            self.reset_ns = now
            self.refusals.append(self.graph.bridge.reset_safety())

    def on(self, topic: str, since_ns: int = 0, until_ns: int = 10**18) -> list[Any]:
        return [m for now, name, m in self.messages if name == topic and since_ns <= now <= until_ns]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> StoppedRun:
    return StoppedRun(tmp_path_factory.mktemp("stopped"))


def test_the_episode_goes_on_and_the_next_one_is_run(run: StoppedRun) -> None:
    assert "still moves" in run.refusals[0] and run.refusals[1] == ""
    assert [(o.episode, o.reason, o.actions) for o in run.on(OUTCOME)] == [
        (0, "action_limit", 2),
        (1, "action_limit", 2),
    ]
    assert [(m.episode, m.step) for m in run.on(EXECUTED)] == [(0, 0), (0, 1), (1, 0), (1, 1)]


def test_the_motion_is_given_up_and_told(run: StoppedRun) -> None:
    (status,) = run.on(STATUS, run.stopped_ns, run.reset_ns)
    assert status.status == status.STOPPED and "stopped by the command guard" in status.message
    phases = [m.data for m in run.on(PHASE, run.stopped_ns)]
    assert phases[:2] == ["stopped", "update"]


def test_the_arm_stands_until_something_new_is_asked_for(run: StoppedRun) -> None:
    def positions(since: int, until: int) -> np.ndarray:
        return np.array([m.position for m in run.on(JOINTS, since, until)])

    asked = next(now for now, name, m in run.messages if name == ACTION and now > run.reset_ns)
    rest = positions(run.stopped_ns + SECOND // 2, asked)
    assert len(rest) > 100
    assert np.ptp(rest, axis=0).max() < 2e-3  # it sags by its tracking error, no more
    limits = cell_named().tool_arm.limits
    speeds = np.array([m.velocity for m in run.on(JOINTS, run.stopped_ns)])
    assert (np.abs(speeds) < limits.velocity).all()


def test_no_guard_refuses_what_comes_after(run: StoppedRun) -> None:
    levels = [m.level[0] for m in run.on(SAFETY, run.reset_ns + 1)]
    assert levels[0] == 0 and set(levels) == {0}


def test_a_replay_of_its_bag_says_the_same(run: StoppedRun, tmp_path: Path) -> None:
    from samrl_ros.cell.replay import replay
    from samrl_ros.nodes.registry import entry

    settings = {"supervisor": run.settings}
    make = {
        name: lambda outbox, name=name: entry(name).behaviour(
            entry(name).settings(**settings.get(name, {})), outbox
        )
        for name in ("supervisor", "manipulator")
    }
    report = replay(record(tmp_path / "bag", run.messages), make)
    for topic, row in report.outputs.items():
        assert row["replayed"] == row["recorded"], topic


@pytest.mark.thorough
def test_a_stop_between_two_episodes_holds_the_next_one(tmp_path: Path) -> None:
    just_ended = 300_000_000  # since the first episode's last action was asked for; the next is asked for
    run = StoppedRun(tmp_path, after_ns=just_ended, actions=1)
    reasons = [(o.episode, o.reason) for o in run.on(OUTCOME)]
    assert reasons == [(0, "action_limit"), (1, "action_limit")]
    assert not run.on(READY, run.stopped_ns, run.reset_ns) and run.on(READY, run.reset_ns)


@pytest.mark.thorough
def test_an_answer_from_before_the_reset_moves_nothing(tmp_path: Path) -> None:
    """A policy that was computing when the stop came speaks while the arm stands."""
    late: list[Any] = []

    def answer_late(run: StoppedRun) -> None:
        late.append(run.on(ACTION)[-1])
        run.graph.queue.append((ACTION, late[0]))

    run = StoppedRun(tmp_path, answer_late, episodes=1)
    rejected = [m for m in run.on(STATUS, run.stopped_ns) if m.status == m.REJECTED]
    assert len(rejected) == 1 and "stopped tool_arm" in rejected[0].message
    assert [(m.episode, m.step) for m in run.on(EXECUTED)] == [(0, 0), (0, 1)]
