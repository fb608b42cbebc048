"""Which model state and which image answer a request when messages come late, twice, or out of order."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.common.errors import InputError

pytest.importorskip("rclpy")
pytestmark = pytest.mark.ros
TASK, CELL = task_named("peg_insertion"), cell_named()
NAMES = tuple(spec.name for spec in TASK.parameters())
MS = 1_000_000


class Listener:
    """`StepInputs` of one stage, and what arrives at it; stamps in [ms]."""

    def __init__(self, stage: str) -> None:
        from samrl_ros.conversions import to_message
        from samrl_ros.nodes.step_inputs import StepInputs

        self.logs: list[tuple[str, str]] = []
        self.joints_lost = False
        self.inputs = StepInputs(stage, NAMES, CELL, 30, lambda *entry: self.logs.append(entry))
        self._take("camera/calibration", to_message.calibration(CELL))

    def _take(self, topic: str, message: Any) -> tuple[int, int] | None:
        found = self.inputs.take(f"/cell/{topic}", message)
        if found is None:
            return None
        return found.estimate.stamp_ns // MS, found.observation.stamp_ns // MS

    def image(self, ms: int) -> tuple[int, int] | None:
        """An image and the joint states of its time; returns stamps of the state and image that answer."""
        from samrl_core.cell.types.observation import ArmReading
        from samrl_ros.conversions import to_message

        stamp, k = ms * MS, CELL.intrinsics
        for name, encoding, dtype in (
            ("color/image_raw", "rgb8", np.uint8),
            ("depth/image_rect_raw", "32FC1", np.float32),
            ("mask/image_raw", "mono8", np.uint8),
        ):
            shape = (k.height, k.width, 3) if encoding == "rgb8" else (k.height, k.width)
            self._take(f"camera/{name}", to_message.image(np.ones(shape, dtype), encoding, stamp, ""))
        self._take("camera/color/camera_info", to_message.camera_info(k, stamp, ""))
        found = None
        for role in ("tool_arm", "camera_arm"):
            zero, now = np.zeros(7), stamp + 50 * MS * self.joints_lost
            message = to_message.joint_state(ArmReading(now, zero, zero, zero), CELL.arm(role).joint_names)
            found = self._take(f"{role}/joint_states", message) or found
        return found

    def state(self, ms: int, step: int = 0) -> tuple[int, int] | None:
        """The state that an image of that time led to."""
        from dataclasses import replace

        from samrl_core.model.model import Model
        from samrl_core.model.real2sim.real2sim import initial_estimate
        from samrl_ros.conversions import model_state

        global _ESTIMATE
        if _ESTIMATE is None:
            _ESTIMATE = initial_estimate(Model(TASK, CELL))
        estimate = replace(_ESTIMATE, stamp_ns=ms * MS)
        return self._take("model_updater/state", model_state.to_message(estimate, TASK, 0, step))

    def ask(self, stage: str, ms: int, step: int = 0) -> tuple[int, int] | None:
        """The supervisor's request."""
        from samrl_msgs.msg import StepRequest

        from samrl_ros.conversions import to_message

        request = StepRequest(header=to_message.header(ms * MS), step=step, stage=stage)
        return self._take("supervisor/request", request)


_ESTIMATE: Any = None


def test_the_state_and_its_image_answer() -> None:
    listener = Listener("view")
    listener.ask("update", 1000)
    for ms in (1100, 1200, 1300):
        listener.image(ms)
    listener.state(1200)
    assert listener.ask("view", 1400) == (1200, 1200)


def test_a_state_newer_than_the_request_is_not_meant() -> None:
    """An update asked for again is answered once more; the view was asked for after the first answer."""
    listener = Listener("view")
    listener.ask("update", 1000)
    listener.image(1100)
    listener.state(1100)
    listener.ask("update", 1000)  # again, on its way when the answer came
    listener.image(1500)
    listener.state(1500)
    assert listener.ask("view", 1200) == (1100, 1100)
    assert listener.ask("view", 1600) == (1500, 1500)


def test_a_state_that_is_newer_alone_waits_for_the_one_that_is_meant() -> None:
    listener = Listener("view")
    listener.ask("update", 1000)
    listener.image(1100)
    listener.state(1500)
    assert listener.ask("view", 1200) is None
    assert listener.state(1100) == (1100, 1100)


def test_an_update_that_came_late_has_its_image_all_the_same() -> None:
    """The updater was busy for three seconds and used the image of then: here they all have arrived."""
    listener = Listener("act")
    listener.ask("update", 1000)
    for ms in range(1100, 4600, 100):
        listener.image(ms)
    listener.state(4000)
    assert listener.ask("act", 4050) == (4000, 4000)
    assert not listener.logs


def test_where_the_image_was_lost_the_next_one_answers() -> None:
    listener = Listener("act")
    listener.ask("update", 1000)
    listener.image(1100)
    listener.state(1200)
    assert listener.ask("act", 1300) is None
    assert listener.image(1400) == (1200, 1400)


def test_images_without_joint_states_are_left_out_and_told_now_and_then() -> None:
    """Joint states got lost on the way; a clock of another time ends it."""
    listener = Listener("act")
    listener.image(900)
    listener.ask("update", 1000)
    listener.joints_lost = True
    for ms in range(1100, 1100 + 29 * 100, 100):
        listener.image(ms)
    assert listener.inputs.left_out == 29 == listener.inputs.bad_frames
    assert [level for level, _ in listener.logs] == ["warn", "warn"]
    assert "1 images left out so far: no joint state of tool_arm" in listener.logs[0][1]
    assert listener.logs[1][1].startswith("10 images")
    with pytest.raises(InputError, match="share a clock"):
        listener.image(4000)


def test_a_new_episode_forgets() -> None:
    from samrl_msgs.msg import EpisodeReady

    listener = Listener("act")
    listener.ask("update", 1000)
    listener.image(1100)
    listener.state(1100)
    listener._take("sim_bridge/ready", EpisodeReady(task=TASK.name))
    assert listener.ask("act", 1300) is None
