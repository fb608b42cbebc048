"""Episodes of a cell without a simulator: a person lays the scene, says when it is ready, and may judge."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from std_msgs.msg import String

from samrl_core.cell.robots.robot import ROLES, CellSpec
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.observation import ArmReading
from samrl_core.common.errors import InputError
from samrl_ros.contract.behaviour import Outbox
from samrl_ros.contract.topics import cell_topic

REQUEST, JUDGEMENT = cell_topic("operator/request"), cell_topic("operator/judgement")
SCENE_READY, JUDGE = cell_topic("operator/scene_ready"), cell_topic("operator/judge")
START_TOLERANCE_RAD = 0.1  # of a joint from the task's start: within what the policy has seen, and reaches
REST_SPEED = 0.02  # [rad/s]


class OperatorEpisodes:
    """What is asked of the operator, and what the answers lead to. Nothing here moves an arm.

    An episode begins when `start` was asked for and the operator has said that the scene is ready; it ends
    with its outcome. With `judged`, it also has to be judged before the next one is asked for.
    """

    def __init__(self, outbox: Outbox, cell: CellSpec, task: Task, judged: bool) -> None:
        self._outbox = outbox
        self._cell, self._task, self._judged = cell, task, judged
        self._start = task.start_joints(cell)
        self._to_lay = -1  # episode whose scene is to be laid, -1 for none
        self._to_judge = -1
        self.running = -1  # episode in which the arms may be commanded, -1 for none

    def ask(self, episode: int) -> None:
        """The supervisor wants an episode. The question waits for the judgement of the one before."""
        self._to_lay, self.running = episode, -1
        self._publish_question()

    def end(self, episode: int) -> None:
        """An outcome: from here on no command is taken."""
        if episode != self.running:
            return
        self.running = -1
        if self._judged:
            self._to_judge = episode
            self._publish_question()

    def record_judgement(self, success: bool) -> str:
        """The operator says how the last episode ended; returns why that is refused, empty when noted."""
        if self._to_judge < 0:
            return "no episode waits to be judged"
        content = {"episode": self._to_judge, "success": success}
        self._outbox.publish(JUDGEMENT, String(data=json.dumps(content)))
        self._to_judge = -1
        self._publish_question()
        return ""

    def begin(self, readings: dict[str, ArmReading]) -> int:
        """The operator says that the scene is ready: the episode that may begin now.

        Args:
            readings: newest of each arm.

        Raises:
            InputError: nobody asked, an arm moves, or is not where the task starts; nothing changes.
        """
        if self._to_judge >= 0:
            raise InputError(f"episode {self._to_judge} waits to be judged; call {JUDGE} first")
        if self._to_lay < 0:
            raise InputError("no episode waits for its scene")
        for role in ROLES:
            self._require_start(role, readings.get(role))
        self.running, self._to_lay = self._to_lay, -1
        self._publish_question()
        return self.running

    def _require_start(self, role: str, reading: ArmReading | None) -> None:
        if reading is None:
            raise InputError(f"no joint state of {role} yet; start its driver")
        names = self._cell.arm(role).joint_names
        speed = np.abs(reading.velocity)
        if not speed.max() <= REST_SPEED:  # so that NaN is refused
            j = int(np.argmax(speed))
            raise InputError(f"{names[j]} moves at {speed[j]:.3f} rad/s, must be below {REST_SPEED} rad/s")
        off = np.abs(reading.position - self._start[role])
        if not off.max() <= START_TOLERANCE_RAD:
            j = int(np.argmax(off))
            raise InputError(
                f"{names[j]} is at {reading.position[j]:.3f} rad, the task starts at "
                f"{self._start[role][j]:.3f} rad, tolerance {START_TOLERANCE_RAD} rad; bring {role} to "
                f"{np.round(self._start[role], 3).tolist()} rad"
            )

    def _publish_question(self) -> None:
        if self._to_judge >= 0:
            asks, episode = "judgement", self._to_judge
            text = (
                f"episode {episode} has ended: did it succeed? ros2 service call {JUDGE} std_srvs/srv/SetBool"
            )
        elif self._to_lay >= 0:
            asks, episode = "scene", self._to_lay
            text = (
                f"episode {episode}: lay the scene of {self._task.name}, bring both arms to the start, stand "
                f"back, then: ros2 service call {SCENE_READY} std_srvs/srv/Trigger"
            )
        else:
            asks, episode, text = "nothing", self.running, ""
        content: dict[str, Any] = {"asks": asks, "episode": episode, "text": text}
        if asks == "scene":
            content["start"] = {role: self._start[role].tolist() for role in ROLES}
        self._outbox.publish(REQUEST, String(data=json.dumps(content)))
