"""Images in, updated model out (Algorithm 1, lines 3 and 8)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch

from samrl_core.errors import InputError, SolveError
from samrl_core.model.model import Model
from samrl_core.prediction import likeliest, predictions
from samrl_core.real2sim import Estimate, Real2Sim, initial_estimate
from samrl_core.robots.cell import default_cell
from samrl_core.tasks import task_named
from samrl_core.types.observation import Observation
from samrl_ros import assembly
from samrl_ros.behaviour import Behaviour, Outbox
from samrl_ros.conversions import from_message, to_message
from samrl_ros.conversions import model_state as model_state_message
from samrl_ros.settings import setting
from samrl_ros.topics import cell_topic

READY, REQUEST = cell_topic("sim_bridge/ready"), cell_topic("supervisor/request")
STATE, IMAGE = cell_topic("model_updater/state"), cell_topic("model_updater/image")


@dataclass(frozen=True)
class ModelUpdaterSettings:
    """Settings of `model_updater`."""

    task: str = setting("peg_insertion", "task whose scene the model holds")
    enabled: bool = setting(True, "false leaves the model as it starts: for ablations")
    max_bad_frames: int = setting(30, "refused images in a row before the node gives up", range=(1, 1000))


class ModelUpdater(Behaviour):
    """Fits the model to the first usable image that is not older than the request."""

    name = "model_updater"
    inputs = (READY, REQUEST, *assembly.INPUTS)
    outputs = (STATE, IMAGE)

    def __init__(self, settings: ModelUpdaterSettings, outbox: Outbox) -> None:
        self._settings = settings
        self._outbox = outbox
        self._task = task_named(settings.task)
        cell = default_cell()
        self._model = Model(self._task, cell)
        self._real2sim = Real2Sim(self._model)
        self._assembler = assembly.Assembler(cell)
        self._estimate: Estimate = initial_estimate(self._model)
        self._tip: np.ndarray | None = None  # when the last image was taken, None before the first [m]
        self._request: Any = None
        self._bad_frames = 0
        self._updates = 0

    def start(self) -> None:
        """See `Behaviour`: the physics is compiled before the first request."""
        self._model.dynamics.prepare()

    def handle(self, topic: str, message: Any) -> None:
        """See `Behaviour`."""
        if topic == READY:
            self._estimate = initial_estimate(self._model)
            self._request = self._tip = None
        elif topic == REQUEST:
            if message.stage == "update":
                self._request = message
        elif topic not in assembly.FRAME or self._wanted(from_message.stamp_ns(message)):
            # Images taken during a fit wait in the queue, their joint states are no longer in theirs: what
            # nobody asked for is not put together, or every fit would end with refusals.
            observation = self._assemble(topic, message)
            if observation is not None and self._wanted(observation.stamp_ns):
                self._update(observation)

    def status(self) -> dict[str, str]:
        """See `Behaviour`."""
        return {
            "updates": str(self._updates),
            "bad_frames_in_a_row": str(self._bad_frames),
            "why_stopped": self._estimate.why_stopped,
        }

    def _assemble(self, topic: str, message: Any) -> Observation | None:
        try:
            observation = self._assembler.take(topic, message)
        except InputError as error:
            self._bad_frames += 1
            if self._bad_frames >= self._settings.max_bad_frames:
                raise
            self._outbox.log("error", f"refused a message on {topic}: {error}")
            return None
        if observation is not None:
            self._bad_frames = 0
        return observation

    def _wanted(self, stamp_ns: int) -> bool:
        return self._request is not None and stamp_ns >= from_message.stamp_ns(self._request)

    def _predictions(self, observation: Observation) -> tuple[Estimate, ...]:
        """The estimate after what the tool did since the last image, in each way that it may have gone."""
        tip = self._model.tip_in_base(observation.tool_arm.position).position
        before, self._tip = self._tip, tip
        if before is None:
            return (self._estimate,)
        try:
            return predictions(self._model.dynamics, self._task.parameters(), self._estimate, before, tip)
        except SolveError as error:
            self._outbox.log("error", f"the last estimate stands in for a prediction: {error}")
            return (self._estimate,)

    def _update(self, observation: Observation) -> None:
        request, self._request = self._request, None
        if self._settings.enabled:
            updates = [self._real2sim.update(one, observation) for one in self._predictions(observation)]
            self._estimate = likeliest(updates)
        else:
            self._estimate = replace(self._estimate, stamp_ns=observation.stamp_ns, why_stopped="disabled")
        self._updates += 1
        self._outbox.publish(
            STATE, model_state_message.to_message(self._estimate, self._task, request.episode, request.step)
        )
        with torch.no_grad():
            rendered = self._model.render(
                torch.as_tensor(self._estimate.values),
                torch.as_tensor(self._estimate.colors),
                observation.camera,
                observation.tool_arm.position,
            ).color.numpy()
        pixels = np.clip(np.round(rendered * 255.0), 0, 255).astype(np.uint8)
        self._outbox.publish(
            IMAGE, to_message.image(pixels, "rgb8", observation.stamp_ns, "camera_color_optical_frame")
        )
