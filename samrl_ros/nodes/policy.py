"""Updated model and real image in, nominal action and residual out (Algorithm 1, lines 4, 9 and 18)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from samrl_msgs.msg import ToolAction

from samrl_core.cell.calibration.cell_correction import correction_of
from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.tasks import DEFAULT_TASK, task_named
from samrl_core.common.errors import InputError
from samrl_core.model.model import Model
from samrl_core.policy.agent.agent import Agent
from samrl_core.policy.agent.policies import ACTOR_IMAGES, POLICIES
from samrl_core.policy.agent.settings import AgentSettings, announced_residual, trained_networks
from samrl_ros.contract.behaviour import Behaviour, Outbox
from samrl_ros.contract.settings import IMAGES_KEPT, setting
from samrl_ros.contract.topics import cell_topic
from samrl_ros.conversions import from_message, to_message
from samrl_ros.nodes import step_inputs
from samrl_ros.nodes.assembly import MAX_BAD_FRAMES
from samrl_ros.nodes.step_inputs import StepInput, StepInputs

WEIGHTS, ACTION = cell_topic("residual_trainer/weights"), cell_topic("policy/nominal_action")


@dataclass(frozen=True)
class PolicySettings:
    """Settings of `policy`."""

    task: str = setting(DEFAULT_TASK, "task whose scene the model holds")
    cell: str = setting(DEFAULT_CELL, "cell whose arms and camera these are")
    policy: str = setting(
        AgentSettings.policy,
        "nominal action: of the trained actor, or of a plan through the model",
        choices=POLICIES,
        former="view_planner.policy",
    )
    actor_image: str = setting(
        AgentSettings.actor_image,
        "what the trained actor reads: the updated model's image, or the camera's (randomised models)",
        choices=ACTOR_IMAGES,
        former="view_planner.actor_image",
    )
    touch: bool = setting(
        AgentSettings.touch,
        "a held peg is led by what it touches, from where the camera sees it, and a spatula feels first how "
        "high a plate of unknown height is; for policy 'optimised'",
    )
    correction: str = setting(
        "", "cell.json of samrl diagnose --apply, as the bridge has it: how well its numbers are known"
    )
    weights: str = setting("", "folder of the trained networks, empty for those of the package")
    seed: int = setting(0, "seed of exploration", range=(0, 2**31 - 1))
    horizon: int = setting(
        AgentSettings.plan.max_sub_goals,
        "sub-goals that are planned for; only the first action is executed",
        range=(1, 60),
        former="view_planner.horizon",
    )
    exploration: float = setting(
        AgentSettings.exploration,
        "standard deviation of what is added to the residual while it is trained",
        "m",
        (0.0, 0.005),
        former="view_planner.exploration",
    )
    exploration_limit: float = setting(
        AgentSettings.exploration_limit,
        "longest residual tried before the trainer has one; as its `limit`",
        "m",
        (1e-4, 0.02),
        former="view_planner.exploration_limit",
    )
    exploration_memory: float = setting(
        AgentSettings.exploration_memory,
        "correlation of what is added to an action and to the next one",
        range=(0.0, 1.0),
        former="view_planner.exploration_memory",
    )
    task_action_limit: float = setting(
        AgentSettings.longest,
        "longest displacement, residual included; not above manipulator's",
        "m",
        (1e-3, 0.2),
        former="view_planner.task_action_limit",
    )
    max_bad_frames: int = setting(
        MAX_BAD_FRAMES, "refused images in a row before the node gives up", range=(1, 1000)
    )
    images_kept: int = setting(
        IMAGES_KEPT, "images after a request among which the model state's own is found", range=(1, 10_000)
    )


class PolicyNode(Behaviour):
    """Answers "act" requests from the model state and the image that it was updated with."""

    name = "policy"
    inputs = (*step_inputs.INPUTS, WEIGHTS)
    outputs = (ACTION,)
    queues = step_inputs.QUEUES

    def __init__(self, settings: PolicySettings, outbox: Outbox) -> None:
        self._settings = settings
        self._outbox = outbox
        self._task, self._cell = task_named(settings.task), cell_named(settings.cell)
        learned = settings.policy == "learned"
        folder = Path(settings.weights) if settings.weights else None
        networks = trained_networks(self._task.name, self._cell, folder) if learned else None
        asked = AgentSettings(
            policy=settings.policy,
            actor_image=settings.actor_image,
            tip_offset=settings.touch,
            touch=settings.touch,
            seed=settings.seed,
            exploration=settings.exploration,
            exploration_memory=settings.exploration_memory,
            exploration_limit=settings.exploration_limit,
            longest=settings.task_action_limit,
            plan=replace(AgentSettings.plan, max_sub_goals=settings.horizon),
        )
        model = Model(self._task, self._cell)
        self._agent = Agent(
            model,
            asked,
            networks,
            lambda text: outbox.log("error", text),
            verbs=("act",),
            correction=correction_of(settings.correction),
        )
        names = tuple(spec.name for spec in self._task.parameters())
        self._inputs = StepInputs(
            "act", names, self._cell, settings.max_bad_frames, outbox.log, settings.images_kept
        )
        self._residual_version = 0
        self._collected = -1  # steps in the trainer's replay when it first announced its weights

    def start(self) -> None:
        """See `Behaviour`: the physics is compiled before the first request."""
        self._agent.prepare()

    def handle(self, topic: str, message: Any) -> None:
        """See `Behaviour`."""
        if topic == WEIGHTS:
            self._on_weights(message)
            return
        if topic == step_inputs.READY:
            self._agent.begin_episode()
        found = self._inputs.take(topic, message)
        if found is not None:
            self._act(found)

    def status(self) -> dict[str, str]:
        """See `Behaviour`."""
        return {
            "policy": self._settings.policy,
            "residual_version": str(self._residual_version),
            "bad_frames_in_a_row": str(self._inputs.bad_frames),
            "images_left_out": str(self._inputs.left_out),
        }

    def _on_weights(self, message: Any) -> None:
        announced = from_message.announced_weights(message.data)
        if self._collected < 0:  # the first one of this run
            self._collected = announced.steps
            self._agent.explore_from(announced.steps)
        if announced.version == 0:
            self._agent.residual = None
        else:
            if announced.task != self._task.name:
                raise InputError(
                    f"residual of task {announced.task!r} announced, this cell runs {self._task.name!r}; "
                    "give all nodes one task"
                )
            self._agent.residual = announced_residual(
                announced.file, announced.sha256, self._task.name, self._cell
            )
        self._residual_version = announced.version

    def _act(self, found: StepInput) -> None:
        choice = self._agent.act(found.estimate, found.observation)
        header = to_message.header(found.observation.stamp_ns, "world")
        message = ToolAction(header=header, episode=found.request.episode, step=found.request.step)
        message.sub_goal = choice.sub_goal
        message.nominal = to_message.vector(choice.nominal)
        message.residual = to_message.vector(choice.residual)
        self._outbox.publish(ACTION, message)
