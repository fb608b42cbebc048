"""Keeps the residual policy (eqs. 13-16): collects what the cell does, and has it trained beside the cell.

Untrained it is zero and has version 0. Success is what the supervisor detects, never truth.
"""

from __future__ import annotations

import json
from collections import OrderedDict
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from std_msgs.msg import String

from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.tasks import DEFAULT_TASK, task_named
from samrl_core.cell.types.observation import Observation
from samrl_core.common.errors import InputError
from samrl_core.learning.residual.learners import DEFAULT_LEARNER, LEARNERS, create_settings
from samrl_core.learning.residual.replay import End, Replay, ReplayStep
from samrl_core.learning.residual.training import (
    Announcement,
    TrainingSettings,
    announced,
    announcement_of,
    replay_of,
)
from samrl_core.learning.residual.worker import write_settings
from samrl_ros.contract.behaviour import Behaviour, Outbox
from samrl_ros.contract.settings import setting
from samrl_ros.contract.topics import cell_topic
from samrl_ros.conversions import from_message
from samrl_ros.nodes import assembly
from samrl_ros.nodes.training_process import TrainingProcess

EXECUTED, OUTCOME = cell_topic("manipulator/executed_action"), cell_topic("supervisor/outcome")
REQUEST, ACTION = cell_topic("supervisor/request"), cell_topic("policy/nominal_action")
READY, WEIGHTS = cell_topic("sim_bridge/ready"), cell_topic("residual_trainer/weights")
_OWN = TrainingSettings()  # defaults stand there
MAX_FRAMES = 20  # images kept from a request on: the updater takes the first that it can use


@dataclass(frozen=True)
class ResidualTrainerSettings:
    """Settings of `residual_trainer`."""

    task: str = setting(DEFAULT_TASK, "task that the residual belongs to")
    cell: str = setting(DEFAULT_CELL, "cell whose arms and camera these are")
    train: bool = setting(False, "collect transitions and train; false keeps the residual as it is")
    folder: str = setting("", "where replay, training and weights lie; kept across runs, empty for none")
    residual: str = setting("", "a trained residual's weight file to act with, in place of train and folder")
    weights: str = setting("", "folder of the task's trained networks, empty for those of the package")
    seed: int = setting(_OWN.seed, "seed of the training", range=(0, 2**31 - 1))
    learner: str = setting(DEFAULT_LEARNER, "what trains the residual", choices=tuple(LEARNERS))
    limit: float = setting(_OWN.learner.limit, "longest residual", "m", (1e-4, 0.02))
    batch: int = setting(_OWN.learner.batch_size, "transitions per update", range=(1, 4096))
    capacity: int = setting(_OWN.capacity, "transitions kept, 82 kB each", range=(100, 1_000_000))
    first_steps: int = setting(_OWN.first_steps, "transitions before the first update", range=(1, 1_000_000))
    updates_per_step: float = setting(
        _OWN.updates_per_step, "updates that each further transition allows", range=(0.01, 100.0)
    )
    publish_every: int = setting(
        _OWN.publish_every, "updates from one version to the next", range=(1, 1_000_000)
    )
    cpu_share: float = setting(_OWN.cpu_share, "of one core that the training may use", range=(0.01, 1.0))

    def training(self) -> TrainingSettings:
        """The same for the training."""
        return TrainingSettings(
            create_settings(self.learner, limit=self.limit, batch_size=self.batch),
            self.seed,
            self.capacity,
            self.first_steps,
            self.updates_per_step,
            self.publish_every,
            self.cpu_share,
        )


class ResidualTrainer(Behaviour):
    """Announces the residual in force. With `train`, every executed action goes into the replay with the
    image that it was chosen from, and a process of its own trains on it.
    """

    name = "residual_trainer"
    inputs = (READY, REQUEST, ACTION, EXECUTED, OUTCOME, *assembly.INPUTS)
    outputs = (WEIGHTS,)

    def __init__(self, settings: ResidualTrainerSettings, outbox: Outbox) -> None:
        self._settings = settings
        self._outbox = outbox
        self._transitions = self._episodes = self._successes = self._missed = 0
        self._varied = False  # whether any residual was not zero
        self._version = 0
        self._replay: Replay | None = None
        self._process: TrainingProcess | None = None
        if settings.residual and (settings.train or settings.folder):
            raise InputError("`residual` is a file that stays as it is; leave out `train` and `folder`")
        if not settings.train:
            self.inputs = (READY, EXECUTED, OUTCOME)  # images would be put together for nothing
            return
        if not settings.folder:
            raise InputError("train needs `folder`: the replay and the training must outlive this process")
        cell, task = cell_named(settings.cell), task_named(settings.task)
        self._cell = cell
        self._arm = ArmModel(cell.tool_arm, cell.tool_base_in_world, None)
        self._tip_in_flange = task.scene(cell).tool.tip_in_flange
        self._assembler = assembly.Assembler(cell)
        self._asked_ns: int | None = None  # stamp of the newest request for an update
        self._frames: OrderedDict[int, Observation] = OrderedDict()  # since then, by stamp
        self._chosen: tuple[tuple[float, ...], Observation] | None = None  # `_identity`, and what was seen
        self._recorded: tuple[int, int, int] | None = None  # episode of the cell, of the replay; last number

    def start(self) -> None:
        """See `Behaviour`: what an earlier run has trained is in force at once."""
        settings, folder = self._settings, Path(self._settings.folder)
        if settings.train:
            training = settings.training()
            self._replay = Replay.write(*replay_of(folder, settings.task, self._cell, training))
            write_settings(folder, training)
            self._process = TrainingProcess(folder, settings.task, settings.cell, settings.weights)
        self._announce(self._newest())

    def stop(self) -> None:
        """See `Behaviour`: the training saves its state."""
        process, self._process = self._process, None
        if process is not None and not process.stop():
            self._outbox.log("warn", "the training did not stop in time and goes on from its last version")
        if self._replay is not None:
            self._replay.close()

    def handle(self, topic: str, message: Any) -> None:
        """See `Behaviour`."""
        if self._process is not None:
            self._process.check()  # joint states come all the time: its end is noticed at once
        if topic == EXECUTED:
            self._transitions += 1
            self._record(message)
        elif topic == OUTCOME:
            self._episodes += 1
            self._successes += int(message.detected_success)
            self._end(message)
        elif self._replay is None or topic == READY:
            return
        elif topic == REQUEST:
            if message.stage == "update":
                if self._chosen is not None and self._chosen[0][:2] == (message.episode, message.step):
                    self._cut()  # the action was given up, and the step begins anew
                self._asked_ns = from_message.stamp_ns(message)
                self._frames.clear()
        elif topic == ACTION:
            seen = self._frames.get(from_message.stamp_ns(message))
            self._chosen = (_identity(message), seen) if seen is not None else None
        elif topic not in assembly.FRAME or self._wanted(from_message.stamp_ns(message)):
            self._see(topic, message)

    def status(self) -> dict[str, str]:
        """See `Behaviour`."""
        return {
            "version": str(self._version),
            "transitions": str(self._transitions),
            "episodes": str(self._episodes),
            "detected_successes": str(self._successes),
            "missed": str(self._missed),
            "training": str(self._process is not None).lower(),
        }

    def _newest(self) -> Announcement:
        settings = self._settings
        if settings.residual:
            return announcement_of(Path(settings.residual), settings.task)
        if settings.folder:
            return announced(Path(settings.folder), settings.task)
        return Announcement(settings.task)

    def _announce(self, weights: Announcement) -> None:
        self._version = weights.version
        announcement = replace(weights, steps=self._replay.last if self._replay is not None else 0)
        self._outbox.publish(WEIGHTS, String(data=json.dumps(asdict(announcement))))

    def _look_after_training(self) -> None:
        """Announce a new version when there is one."""
        if self._process is None:
            return
        newest = self._newest()
        if newest.version != self._version:
            self._announce(newest)

    def _wanted(self, stamp_ns: int) -> bool:
        return self._asked_ns is not None and stamp_ns >= self._asked_ns and len(self._frames) < MAX_FRAMES

    def _see(self, topic: str, message: Any) -> None:
        try:
            observation = self._assembler.take(topic, message)
        except InputError as error:
            self._outbox.log("warn", f"left out a message on {topic}: {error}")
            return
        if observation is not None and self._wanted(observation.stamp_ns):
            self._frames[observation.stamp_ns] = observation

    def _record(self, message: Any) -> None:
        """An executed action, with the image that the model was updated from before it was chosen."""
        if self._replay is None:
            return
        chosen, self._chosen = self._chosen, None
        if chosen is None or chosen[0] != _identity(message):
            self._missed += 1
            self._recorded = None  # the episode's end belongs to an action that is not there
            self._outbox.log("warn", f"action {message.step}: its image was not seen, it is not learnt from")
        else:
            last = self._recorded
            known = last is not None and last[0] == message.episode
            episode = last[1] if last is not None and known else self._replay.next_episode()
            number = self._replay.append(self._step(message, episode, chosen[1]))
            self._recorded = (message.episode, episode, number)
            self._check_exploration(from_message.vector(message.residual))
        self._look_after_training()

    def _check_exploration(self, residual: np.ndarray) -> None:
        """Warn when all residuals are zero: a critic then learns nothing about other ones."""
        self._varied = self._varied or bool(residual.any())
        if self._transitions == self._settings.first_steps and not self._varied:
            self._outbox.log("warn", "all residuals are zero so far; set policy's `exploration`")

    def _step(self, message: Any, episode: int, observation: Observation) -> ReplayStep:
        flange = self._arm.flange_in_base(observation.tool_arm.position)
        return ReplayStep(
            episode,
            message.step,
            observation.frame.color,
            observation.frame.depth,
            observation.camera.camera_in_world,
            (flange @ self._tip_in_flange).position,
            from_message.vector(message.nominal),
            from_message.vector(message.residual),
            from_message.vector(message.executed),
        )

    def _cut(self) -> None:
        """What comes next does not follow from the last action alone."""
        recorded, self._recorded, self._chosen = self._recorded, None, None
        if recorded is not None and self._replay is not None:
            self._replay.end_episode(recorded[2], End.CUT)

    def _end(self, message: Any) -> None:
        """Stores the episode's end with its last action; a fault says nothing about the action."""
        if self._replay is None:
            return
        recorded, self._recorded, self._chosen = self._recorded, None, None
        if recorded is not None and recorded[0] == message.episode:
            limit = message.reason == "action_limit"
            end = End.SUCCESS if message.detected_success else End.FAILURE if limit else End.CUT
            self._replay.end_episode(recorded[2], end)
        self._look_after_training()


def _identity(action: Any) -> tuple[float, ...]:
    """Episode, step and what was asked for: a policy that was started anew may have chosen twice."""
    n, r = action.nominal, action.residual
    return (action.episode, action.step, n.x, n.y, n.z, r.x, r.y, r.z)
