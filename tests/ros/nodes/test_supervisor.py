"""What the supervisor asks for after an update that says "done"."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.tasks.peg_insertion.task import PegInsertion
from samrl_core.model.model import Model
from samrl_core.model.real2sim.real2sim import initial_estimate

pytest.importorskip("rclpy")
pytestmark = pytest.mark.ros
TASK = task_named("peg_insertion")
SECOND = 1_000_000_000


class Outbox:
    """Keeps what is asked for and how the episode ended; starts an episode unless that is refused."""

    def __init__(self) -> None:
        self.refusals: list[str] = []  # of the next episodes
        self.starts = 0
        self.told: list[str] = []
        self.asked: list[tuple[str, int]] = []  # stage and stamp [ns]
        self.ends: list[tuple[bool, str]] = []

    def publish(self, topic: str, message: Any) -> None:
        from samrl_ros.conversions import from_message
        from samrl_ros.nodes.supervisor import OUTCOME, REQUEST

        if topic == REQUEST:
            self.asked.append((message.stage, from_message.stamp_ns(message)))
        elif topic == OUTCOME:
            self.ends.append((message.detected_success, message.reason))

    def log(self, level: str, text: str) -> None:
        self.told.append(text)

    def call(self, service: str, request: Any, on_response: Callable[[Any], None]) -> None:
        self.starts += 1
        refusal = self.refusals.pop(0) if self.refusals else ""
        on_response(type("Response", (), {"success": not refusal, "message": refusal})())


@pytest.fixture(scope="module")
def estimate() -> Any:
    return initial_estimate(Model(TASK, cell_named()))


@pytest.fixture
def verdicts(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[bool]]:
    """What the model says, update by update."""
    left: list[bool] = []
    monkeypatch.setattr(PegInsertion, "is_done", lambda *_: left.pop(0))
    yield left
    assert not left


def updates(estimate: Any, count: int, why_stopped: str = "converged", **settings: Any) -> Outbox:
    """An episode begins, and `count` updates answer so, each 0.4 s after it was asked for."""
    from samrl_msgs.msg import EpisodeReady

    from samrl_ros.conversions import model_state, to_message
    from samrl_ros.nodes.supervisor import READY, STATE, Supervisor, SupervisorSettings

    outbox = Outbox()
    supervisor = Supervisor(SupervisorSettings(**settings), outbox)
    supervisor.start()
    ready = EpisodeReady(header=to_message.header(SECOND), episode=0, task=TASK.name)
    supervisor.handle(READY, ready)
    for _ in range(count):
        stage, asked_ns = outbox.asked[-1]
        assert stage == "update"
        stamp_ns = asked_ns + 400_000_000
        now = replace(estimate, stamp_ns=stamp_ns, why_stopped=why_stopped, loss_after=0.05)
        supervisor.handle(STATE, model_state.to_message(now, TASK, 0, 0))
    return outbox


def test_done_is_asked_for_twice(estimate: Any, verdicts: list[bool]) -> None:
    verdicts += [True, True]
    found = updates(estimate, 2)
    assert [stage for stage, _ in found.asked] == ["update", "update"]
    assert found.asked[1][1] >= found.asked[0][1] + 400_000_000  # from an image after the first one
    assert found.ends == [(True, "done")]


def test_one_image_that_says_done_is_not_enough(estimate: Any, verdicts: list[bool]) -> None:
    verdicts += [True, False]
    found = updates(estimate, 2)
    assert [stage for stage, _ in found.asked] == ["update", "update", "view"] and not found.ends


def test_as_many_as_are_asked_for(estimate: Any, verdicts: list[bool]) -> None:
    verdicts += [True]
    assert updates(estimate, 1, done_confirmations=1).ends == [(True, "done")]


def test_an_image_that_did_not_settle_is_taken_again_once(
    estimate: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(PegInsertion, "needs_aim", lambda *_: True)
    found = updates(estimate, 2, why_stopped="iteration_limit")
    assert [stage for stage, _ in found.asked] == ["update", "update", "view"] and not found.ends


def test_a_model_that_is_not_updated_ends_nothing(estimate: Any) -> None:
    found = updates(estimate, 1, stop_on_model_success=False)
    assert found.asked[-1][0] == "view" and not found.ends


def test_no_request_is_older_than_the_state_that_it_follows(estimate: Any) -> None:
    """Joint states that waited in the queue must not set the time back."""
    from samrl_msgs.msg import EpisodeReady, ViewTarget

    from samrl_core.cell.types.observation import ArmReading
    from samrl_ros.conversions import model_state, to_message
    from samrl_ros.nodes.supervisor import (
        READY,
        STATE,
        TARGET,
        TOOL_JOINTS,
        Supervisor,
        SupervisorSettings,
    )

    outbox = Outbox()
    supervisor = Supervisor(SupervisorSettings(stop_on_model_success=False), outbox)
    supervisor.start()
    supervisor.handle(READY, EpisodeReady(header=to_message.header(SECOND), episode=0, task=TASK.name))
    late = replace(estimate, stamp_ns=5 * SECOND, why_stopped="converged", loss_after=0.05)
    supervisor.handle(STATE, model_state.to_message(late, TASK, 0, 0))
    zero = np.zeros(7)
    reading = to_message.joint_state(
        ArmReading(4 * SECOND, zero, zero, zero), cell_named().tool_arm.joint_names
    )
    supervisor.handle(TOOL_JOINTS, reading)
    supervisor.handle(TARGET, ViewTarget(episode=0, step=0, move=False))
    assert outbox.asked[-2:] == [("view", 5 * SECOND), ("act", 5 * SECOND)]


@pytest.mark.parametrize(
    ("heed_touch", "last", "ends"),
    [
        (False, "bottom", []),
        (True, "bottom", [(True, "done")]),
        (True, "forced", [(False, "pressed too hard")]),
    ],
)
def test_a_peg_that_is_felt_at_the_bottom_ends_the_episode_where_touch_is_heeded(
    estimate: Any, heed_touch: bool, last: str, ends: list[tuple[bool, str]]
) -> None:
    from samrl_msgs.msg import EpisodeReady, ToolAction, ViewTarget

    from samrl_ros.conversions import model_state, to_message
    from samrl_ros.nodes.supervisor import EXECUTED, READY, STATE, TARGET, Supervisor, SupervisorSettings

    outbox = Outbox()
    supervisor = Supervisor(SupervisorSettings(heed_touch=heed_touch, view_period=10), outbox)
    supervisor.start()
    supervisor.handle(READY, EpisodeReady(header=to_message.header(SECOND), episode=0, task=TASK.name))
    for step, name in enumerate(("inside", last)):
        now = replace(
            estimate, stamp_ns=outbox.asked[-1][1] + SECOND, why_stopped="converged", loss_after=0.05
        )
        supervisor.handle(STATE, model_state.to_message(now, TASK, 0, step))
        if outbox.asked[-1][0] == "view":
            supervisor.handle(TARGET, ViewTarget(episode=0, step=step, move=False))
        assert outbox.asked[-1][0] == "act" and not outbox.ends
        supervisor.handle(EXECUTED, ToolAction(episode=0, step=step, sub_goal=name))
    assert outbox.ends == ends


@pytest.mark.parametrize("actions", [1, 5])
def test_who_follows_the_hole_says_when_it_is_done(estimate: Any, verdicts: list[bool], actions: int) -> None:
    """An estimate that says "done" while a peg is led by touch is no end, unless no action is left."""
    from samrl_msgs.msg import EpisodeReady, ToolAction, ViewTarget

    from samrl_ros.conversions import model_state, to_message
    from samrl_ros.nodes.supervisor import EXECUTED, READY, STATE, TARGET, Supervisor, SupervisorSettings

    verdicts += [False, True]
    outbox = Outbox()
    settings = SupervisorSettings(heed_touch=True, view_period=10, max_actions=actions, done_confirmations=1)
    supervisor = Supervisor(settings, outbox)
    supervisor.start()
    supervisor.handle(READY, EpisodeReady(header=to_message.header(SECOND), episode=0, task=TASK.name))
    for step in range(2):
        stamp_ns = outbox.asked[-1][1] + SECOND
        now = replace(estimate, stamp_ns=stamp_ns, why_stopped="converged", loss_after=0.05)
        supervisor.handle(STATE, model_state.to_message(now, TASK, 0, step))
        if outbox.asked[-1][0] == "view":
            supervisor.handle(TARGET, ViewTarget(episode=0, step=step, move=False))
        if step == 0:
            supervisor.handle(EXECUTED, ToolAction(episode=0, step=step, sub_goal="inside"))
    assert outbox.ends == ([(True, "done")] if actions == 1 else [])
    assert actions == 1 or outbox.asked[-1][0] == "act"


def test_an_episode_waits_while_an_arm_has_two_commanders() -> None:
    from samrl_msgs.msg import EpisodeReady

    from samrl_core.cell.types.observation import ArmReading
    from samrl_ros.conversions import to_message
    from samrl_ros.nodes.standstill import why_rivals
    from samrl_ros.nodes.supervisor import READY, TOOL_JOINTS, Supervisor, SupervisorSettings

    outbox, zero = Outbox(), np.zeros(7)
    outbox.refusals = [why_rivals("tool_arm", ("node 'manipulator'", "node 'stranger'"))] * 2
    supervisor = Supervisor(SupervisorSettings(), outbox)
    supervisor.start()
    for tenths in range(1, 11):  # of a second of robot time
        reading = ArmReading(tenths * SECOND // 10, zero, zero, zero)
        supervisor.handle(TOOL_JOINTS, to_message.joint_state(reading, cell_named().tool_arm.joint_names))
    assert outbox.starts == 3 and not outbox.ends and not supervisor.finished
    assert [text for text in outbox.told if "'stranger'" in text and "episode 0 waits" in text] == outbox.told
    assert len(outbox.told) == 1  # once, however often it asks
    supervisor.handle(READY, EpisodeReady(header=to_message.header(SECOND), episode=0, task=TASK.name))
    assert outbox.asked == [("update", SECOND)]
