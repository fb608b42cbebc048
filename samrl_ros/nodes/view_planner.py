"""Updated model in, next view out (Algorithm 1, lines 5-15)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from samrl_msgs.msg import ViewTarget

from samrl_core.cell.calibration.cell_correction import correction_of
from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.tasks import DEFAULT_TASK, task_named
from samrl_core.model.model import Model
from samrl_core.policy.agent.agent import Agent
from samrl_core.policy.agent.policies import STRATEGIES
from samrl_core.policy.agent.settings import AgentSettings, trained_networks
from samrl_core.policy.view.view_planning import ViewChoice
from samrl_ros.contract.behaviour import Behaviour, Outbox
from samrl_ros.contract.settings import IMAGES_KEPT, setting
from samrl_ros.contract.topics import cell_topic
from samrl_ros.conversions import from_message, to_message
from samrl_ros.nodes import step_inputs
from samrl_ros.nodes.assembly import MAX_BAD_FRAMES
from samrl_ros.nodes.step_inputs import StepInput, StepInputs

TARGET, CANDIDATES = cell_topic("view_planner/target"), cell_topic("view_planner/candidates")
ACTION = cell_topic("policy/nominal_action")


@dataclass(frozen=True)
class ViewPlannerSettings:
    """Settings of `view_planner`."""

    task: str = setting(DEFAULT_TASK, "task whose scene the model holds")
    cell: str = setting(DEFAULT_CELL, "cell whose arms and camera these are")
    strategy: str = setting(
        AgentSettings.strategy,
        "how the view is chosen: ascent of the trained Q, expected information, stay, or at random",
        choices=STRATEGIES,
    )
    touch: bool = setting(
        AgentSettings.touch,
        "the camera moves only while the hole is known worse than the held peg, and never in contact; set "
        "with policy's `touch`",
    )
    correction: str = setting(
        "", "cell.json of samrl diagnose --apply, as the bridge has it: how well its numbers are known"
    )
    weights: str = setting("", "folder of the trained networks, empty for those of the package")
    seed: int = setting(0, "seed of the random strategy", range=(0, 2**31 - 1))
    max_bad_frames: int = setting(
        MAX_BAD_FRAMES, "refused images in a row before the node gives up", range=(1, 1000)
    )
    images_kept: int = setting(
        IMAGES_KEPT, "images after a request among which the model state's own is found", range=(1, 10_000)
    )


class ViewPlannerNode(Behaviour):
    """Answers "view" requests from the model state and the image that it was updated with."""

    name = "view_planner"
    inputs = (*step_inputs.INPUTS, ACTION)
    outputs = (TARGET, CANDIDATES)
    queues = step_inputs.QUEUES

    def __init__(self, settings: ViewPlannerSettings, outbox: Outbox) -> None:
        self._settings = settings
        self._outbox = outbox
        task, cell = task_named(settings.task), cell_named(settings.cell)
        learned = settings.strategy == "q"
        folder = Path(settings.weights) if settings.weights else None
        networks = trained_networks(task.name, cell, folder) if learned else None
        touch = settings.touch
        policy = "optimised" if touch else AgentSettings.policy  # which touch belongs to; nothing acts here
        agent = AgentSettings(
            policy=policy, strategy=settings.strategy, tip_offset=touch, touch=touch, seed=settings.seed
        )
        correction = correction_of(settings.correction)
        self._agent = Agent(Model(task, cell), agent, networks, verbs=("plan_view",), correction=correction)
        names = tuple(spec.name for spec in task.parameters())
        self._inputs = StepInputs(
            "view", names, cell, settings.max_bad_frames, outbox.log, settings.images_kept
        )
        self._moves = 0
        self._answer: tuple[tuple[int, int], ViewTarget] | None = None  # stamps of request and state [ns]

    def start(self) -> None:
        """See `Behaviour`: reachable views are there before the first request."""
        self._agent.prepare()

    def handle(self, topic: str, message: Any) -> None:
        """See `Behaviour`."""
        if topic == ACTION:
            self._agent.note_action(message.sub_goal)
            return
        if topic == step_inputs.READY:
            self._agent.begin_episode()
        found = self._inputs.take(topic, message)
        if found is not None:
            self._plan_view(found)

    def status(self) -> dict[str, str]:
        """See `Behaviour`."""
        return {
            "views_chosen": str(self._moves),
            "strategy": self._settings.strategy,
            "bad_frames_in_a_row": str(self._inputs.bad_frames),
            "images_left_out": str(self._inputs.left_out),
        }

    def _plan_view(self, found: StepInput) -> None:
        asked = (from_message.stamp_ns(found.request), from_message.stamp_ns(found.state))
        if self._answer is None or self._answer[0] != asked:  # else asked again while it was being planned
            self._answer = (asked, self._target(found))
        self._outbox.publish(TARGET, self._answer[1])

    def _target(self, found: StepInput) -> ViewTarget:
        choice = self._agent.plan_view(found.estimate, found.observation)
        self._moves += int(choice.move)
        request = found.request
        message = ViewTarget(header=found.state.header, episode=request.episode, step=request.step)
        message.move = bool(choice.move)
        message.camera_in_world = to_message.pose(choice.camera_in_world)
        message.joint_position = np.asarray(choice.joint_position).tolist()
        message.score, message.present_score = float(choice.score), float(choice.present_score)
        message.visibility = float(choice.visibility)
        message.candidates = int(choice.candidates)
        message.reason = choice.reason
        self._publish_candidates(choice, from_message.stamp_ns(found.state))
        return message

    def _publish_candidates(self, choice: ViewChoice, stamp_ns: int) -> None:
        fields = ("x", "y", "z", "score")
        scored = np.array([[*view.camera_in_world.position, view.score] for view in choice.scored])
        cloud = to_message.cloud(scored.reshape(-1, len(fields)), fields, stamp_ns, "world")
        self._outbox.publish(CANDIDATES, cloud)
