"""What the model updater says again."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from samrl_ros.cell.replay import RecordingOutbox

pytest.importorskip("rclpy")
pytestmark = pytest.mark.ros


class Outbox(RecordingOutbox):
    """Keeps what is published; the updater calls no service."""

    def call(self, service: str, request: Any, on_response: Callable[[Any], None]) -> None:
        raise AssertionError(service)


def test_a_state_that_got_lost_is_sent_again_when_a_view_is_asked_for_again() -> None:
    """The request alone would never be answered: the view planner waits for the state that it belongs to."""
    from samrl_msgs.msg import EpisodeReady, ModelState, StepRequest

    from samrl_ros.conversions import to_message
    from samrl_ros.nodes.model_updater import READY, REQUEST, STATE, ModelUpdater, ModelUpdaterSettings

    outbox = Outbox(keep=frozenset({STATE}))
    updater = ModelUpdater(ModelUpdaterSettings(), outbox)
    updater.handle(READY, EpisodeReady(task="peg_insertion"))
    state = ModelState(step=3)
    updater._state = state

    def ask(stage: str, stamp_ns: int) -> int:
        updater.handle(REQUEST, StepRequest(header=to_message.header(stamp_ns), step=3, stage=stage))
        return sum(outbox.counts.values())

    assert ask("view", 5) == 0
    assert ask("view", 5) == 1 and outbox.kept[STATE] == [state]
    assert ask("act", 6) == 1
    assert ask("update", 7) == ask("update", 7) == 1  # what it answers is a new state
    assert ask("view", 8) == 1
    updater.handle(READY, EpisodeReady(task="peg_insertion", episode=1))
    assert ask("view", 8) == 1 and ask("view", 8) == 1  # nothing is known of the new episode


@pytest.mark.parametrize("repeats", [True, False])
def test_an_update_that_is_done_is_not_done_again(repeats: bool) -> None:
    """The request was sent again while it was computed: a second state would be newer than the view's."""
    from samrl_msgs.msg import EpisodeReady, ModelState, StepRequest

    from samrl_ros.conversions import to_message
    from samrl_ros.nodes.model_updater import READY, REQUEST, STATE, ModelUpdater, ModelUpdaterSettings

    outbox = Outbox(keep=frozenset({STATE}))
    updater = ModelUpdater(ModelUpdaterSettings(repeat_answers=repeats), outbox)
    updater.handle(READY, EpisodeReady(task="peg_insertion"))
    request = StepRequest(header=to_message.header(7), step=3, stage="update")
    updater.handle(REQUEST, request)
    assert updater._wanted(8)
    updater._request, updater._state = None, ModelState(step=3)  # as an update leaves it
    updater.handle(REQUEST, request)
    assert len(outbox.kept[STATE]) == repeats and updater._wanted(8) is not repeats
