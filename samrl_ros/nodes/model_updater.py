"""Images in, updated model out (Algorithm 1, lines 3 and 8)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from samrl_core.cell.calibration.cell_correction import correction_of
from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.tasks import DEFAULT_TASK, task_named
from samrl_core.cell.types.observation import Observation
from samrl_core.model.model import Model
from samrl_core.policy.agent.agent import Agent
from samrl_core.policy.agent.settings import AgentSettings
from samrl_ros.contract.behaviour import Behaviour, Outbox
from samrl_ros.contract.settings import setting
from samrl_ros.contract.topics import cell_topic
from samrl_ros.conversions import from_message, to_message
from samrl_ros.conversions import model_state as model_state_message
from samrl_ros.nodes import assembly
from samrl_ros.nodes.assembly import MAX_BAD_FRAMES

READY, REQUEST = cell_topic("sim_bridge/ready"), cell_topic("supervisor/request")
STATE, IMAGE = cell_topic("model_updater/state"), cell_topic("model_updater/image")


@dataclass(frozen=True)
class ModelUpdaterSettings:
    """Settings of `model_updater`."""

    task: str = setting(DEFAULT_TASK, "task whose scene the model holds")
    cell: str = setting(DEFAULT_CELL, "cell whose arms and camera these are")
    enabled: bool = setting(True, "false leaves the model as it starts: for ablations")
    correction: str = setting(
        "", "cell.json of samrl diagnose --apply, as the bridge has it: how well its numbers are known"
    )
    repeat_answers: bool = setting(
        True, "an update that is asked for again when it is done gets the same state; false: updates anew"
    )
    max_bad_frames: int = setting(
        MAX_BAD_FRAMES, "refused images in a row before the node gives up", range=(1, 1000)
    )


class ModelUpdater(Behaviour):
    """Fits the model to the first usable image that is not older than the request."""

    name = "model_updater"
    inputs = (READY, REQUEST, *assembly.INPUTS)
    outputs = (STATE, IMAGE)
    queues = assembly.QUEUES

    def __init__(self, settings: ModelUpdaterSettings, outbox: Outbox) -> None:
        self._outbox, self._repeats = outbox, settings.repeat_answers
        self._task = task_named(settings.task)
        cell = cell_named(settings.cell)
        self._model = Model(self._task, cell)
        self._agent = Agent(
            self._model,
            AgentSettings(update=settings.enabled),
            log=lambda text: outbox.log("error", text),
            verbs=("update_model",),
            correction=correction_of(settings.correction),
        )
        self._frames = assembly.PatientAssembler(cell, settings.max_bad_frames, outbox.log)
        self._request: Any = None
        self._asked: tuple[str, int] | None = None  # stage and stamp [ns] of the newest request
        self._state: Any = None  # published last
        self._updates = 0

    def start(self) -> None:
        """See `Behaviour`: the physics is compiled before the first request."""
        self._agent.prepare()

    def handle(self, topic: str, message: Any) -> None:
        """See `Behaviour`."""
        if topic == READY:
            self._agent.begin_episode()
            self._request = self._asked = self._state = None
        elif topic == REQUEST:
            self._on_request(message)
        else:
            observation = self._frames.take(topic, message, self._wanted)
            if observation is not None:
                self._update(observation)

    def status(self) -> dict[str, str]:
        """See `Behaviour`."""
        return {
            "updates": str(self._updates),
            "bad_frames_in_a_row": str(self._frames.bad_frames),
            "images_left_out": str(self._frames.left_out),
            "why_stopped": self._agent.estimate.why_stopped,
        }

    def _on_request(self, message: Any) -> None:
        asked, self._asked = self._asked, (message.stage, from_message.stamp_ns(message))
        again = asked == self._asked and self._state is not None
        if again and (message.stage != "update" or (self._repeats and self._request is None)):
            self._outbox.publish(STATE, self._state)  # it may have been lost on its way
        elif message.stage == "update":
            self._request = message

    def _wanted(self, stamp_ns: int) -> bool:
        return self._request is not None and stamp_ns >= from_message.stamp_ns(self._request)

    def _update(self, observation: Observation) -> None:
        request, self._request = self._request, None
        estimate = self._agent.update_model(observation)
        self._updates += 1
        self._state = model_state_message.to_message(estimate, self._task, request.episode, request.step)
        self._outbox.publish(STATE, self._state)
        with torch.no_grad():
            rendered = self._model.render(
                torch.as_tensor(estimate.values),
                torch.as_tensor(estimate.colors),
                observation.camera,
                observation.tool_arm.position,
            ).color.numpy()
        pixels = np.clip(np.round(rendered * 255.0), 0, 255).astype(np.uint8)
        self._outbox.publish(
            IMAGE, to_message.image(pixels, "rgb8", observation.stamp_ns, "camera_color_optical_frame")
        )
