"""Keeps the residual policy (eqs. 13-15). Untrained it is zero, and says so as version 0."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from std_msgs.msg import String

from samrl_ros.behaviour import Behaviour, Outbox
from samrl_ros.settings import setting
from samrl_ros.topics import cell_topic

EXECUTED, OUTCOME = cell_topic("manipulator/executed_action"), cell_topic("supervisor/outcome")
READY, WEIGHTS = cell_topic("sim_bridge/ready"), cell_topic("residual_trainer/weights")


@dataclass(frozen=True)
class ResidualTrainerSettings:
    """Settings of `residual_trainer`."""

    task: str = setting("peg_insertion", "task that the residual belongs to")


class ResidualTrainer(Behaviour):
    """Publishes the residual in force and counts the transitions that a learner will train on."""

    name = "residual_trainer"
    inputs = (READY, EXECUTED, OUTCOME)
    outputs = (WEIGHTS,)

    def __init__(self, settings: ResidualTrainerSettings, outbox: Outbox) -> None:
        self._settings = settings
        self._outbox = outbox
        self._transitions = 0
        self._episodes = 0

    def start(self) -> None:
        """See `Behaviour`."""
        weights = {"task": self._settings.task, "version": 0, "file": "", "sha256": ""}
        self._outbox.publish(WEIGHTS, String(data=json.dumps(weights)))

    def handle(self, topic: str, message: Any) -> None:
        """See `Behaviour`."""
        if topic == EXECUTED:
            self._transitions += 1
        elif topic == OUTCOME:
            self._episodes += 1

    def status(self) -> dict[str, str]:
        """See `Behaviour`."""
        return {"version": "0", "transitions": str(self._transitions), "episodes": str(self._episodes)}
