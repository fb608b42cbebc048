"""Updated model in, next view and action out (Algorithm 1, lines 4-15 and 18)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from samrl_msgs.msg import ToolAction, ViewTarget

from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.observation import Observation
from samrl_core.common.errors import InputError
from samrl_core.model.model import Model
from samrl_core.policy.agent.acting import Acting
from samrl_core.policy.agent.looking import Looking
from samrl_core.policy.agent.policies import ACTOR_IMAGES, DEFAULT_POLICY, POLICIES, STRATEGIES, STRATEGY_OF
from samrl_core.policy.agent.settings import AgentSettings, announced_residual, trained_networks
from samrl_core.policy.planning.trajectory import TrajectorySettings
from samrl_ros.contract.behaviour import Behaviour, Outbox
from samrl_ros.contract.settings import setting
from samrl_ros.contract.topics import cell_topic
from samrl_ros.conversions import from_message, to_message
from samrl_ros.conversions.model_state import from_state
from samrl_ros.nodes import assembly

READY, REQUEST = cell_topic("sim_bridge/ready"), cell_topic("supervisor/request")
STATE, WEIGHTS = cell_topic("model_updater/state"), cell_topic("residual_trainer/weights")
TARGET, ACTION = cell_topic("view_planner/target"), cell_topic("view_planner/nominal_action")

_KEPT = 4  # images after a request: the updater takes the first that it can use, one of these


@dataclass(frozen=True)
class ViewPlannerSettings:
    """Settings of `view_planner`."""

    task: str = setting("peg_insertion", "task whose scene the model holds")
    cell: str = setting(DEFAULT_CELL, "cell whose arms and camera these are")
    policy: str = setting(
        DEFAULT_POLICY,
        "nominal action: of the trained actor, or of a plan through the model",
        choices=POLICIES,
    )
    strategy: str = setting(
        STRATEGY_OF[DEFAULT_POLICY],
        "how the view is chosen: ascent of the trained Q, expected information, stay, or at random",
        choices=STRATEGIES,
    )
    actor_image: str = setting(
        ACTOR_IMAGES[0],
        "what the trained actor reads: the updated model's image, or the camera's (randomised models)",
        choices=ACTOR_IMAGES,
    )
    weights: str = setting("", "folder of the trained networks, empty for those of the package")
    seed: int = setting(0, "seed of the random strategy and of exploration", range=(0, 2**31 - 1))
    horizon: int = setting(
        3, "sub-goals that are planned for; only the first action is executed", range=(1, 60)
    )
    exploration: float = setting(
        0.0, "standard deviation of what is added to the residual while it is trained", "m", (0.0, 0.005)
    )
    exploration_limit: float = setting(
        0.003, "longest residual tried before the trainer has one; as its `limit`", "m", (1e-4, 0.02)
    )
    exploration_memory: float = setting(
        0.98, "correlation of what is added to an action and to the next one", range=(0.0, 1.0)
    )
    task_action_limit: float = setting(
        0.02, "longest displacement, residual included; not above manipulator's", "m", (1e-3, 0.2)
    )
    max_bad_frames: int = setting(30, "refused images in a row before the node gives up", range=(1, 1000))


class ViewPlannerNode(Behaviour):
    """Answers "view" and "act" requests from the model state and the image that it was updated with."""

    name = "view_planner"
    inputs = (READY, REQUEST, STATE, WEIGHTS, *assembly.INPUTS)
    outputs = (TARGET, ACTION)

    def __init__(self, settings: ViewPlannerSettings, outbox: Outbox) -> None:
        self._settings = settings
        self._outbox = outbox
        self._task = task_named(settings.task)
        cell = cell_named(settings.cell)
        self._cell = cell
        self._parameters = tuple(spec.name for spec in self._task.parameters())
        model = Model(self._task, cell)
        agent = AgentSettings(
            policy=settings.policy,
            strategy=settings.strategy,
            actor_image=settings.actor_image,
            seed=settings.seed,
            exploration=settings.exploration,
            exploration_memory=settings.exploration_memory,
            exploration_limit=settings.exploration_limit,
            longest=settings.task_action_limit,
            plan=TrajectorySettings(max_sub_goals=settings.horizon, max_iterations=3, spare_actions=1),
        )
        folder = Path(settings.weights) if settings.weights else None
        networks = trained_networks(self._task.name, cell, folder) if agent.needs_networks else None
        self._looking = Looking(model, agent, networks)
        self._acting = Acting(model, agent, networks, lambda text: outbox.log("error", text))
        self._frames = assembly.PatientAssembler(cell, settings.max_bad_frames, outbox.log)
        self._observations: list[Observation] = []  # since the newest update was asked for
        self._wanted_since_ns = 0
        self._wanted_more = 0  # images
        self._update_asked_ns = 0  # stamp of the newest request for an update
        self._state: Any = None
        self._request: Any = None
        self._moves = 0
        self._residual_version = 0
        self._collected = -1  # steps in the trainer's replay when it first announced its weights

    def start(self) -> None:
        """See `Behaviour`: reachable views and compiled physics are there before the first request."""
        self._looking.prepare()
        self._acting.prepare()

    def handle(self, topic: str, message: Any) -> None:
        """See `Behaviour`."""
        if topic == WEIGHTS:
            self._on_weights(message)
        elif topic == READY:
            self._acting.begin()
            self._state = self._request = None
            self._observations, self._wanted_more = [], 0
        elif topic == STATE:
            from_message.model_values(message, self._parameters)  # refused on arrival, not when it is used
            self._state = message
        elif topic == REQUEST:
            self._on_request(message)
        else:
            observation = self._frames.take(topic, message, self._wanted)
            if observation is not None:
                self._wanted_more -= 1
                self._observations.append(observation)
        self._answer()

    def status(self) -> dict[str, str]:
        """See `Behaviour`."""
        return {
            "views_chosen": str(self._moves),
            "policy": self._settings.policy,
            "strategy": self._settings.strategy,
            "residual_version": str(self._residual_version),
            "bad_frames_in_a_row": str(self._frames.bad_frames),
        }

    def _on_request(self, message: Any) -> None:
        asked_ns = from_message.stamp_ns(message)
        if message.stage == "update":
            self._update_asked_ns = asked_ns
        if message.stage in ("view", "act"):
            self._request = message
        elif asked_ns != self._wanted_since_ns:  # else asked again: the updater may have its image already
            self._observations = []
        self._wanted_since_ns, self._wanted_more = asked_ns, _KEPT

    def _wanted(self, stamp_ns: int) -> bool:
        return self._wanted_more > 0 and stamp_ns >= self._wanted_since_ns

    def _on_weights(self, message: Any) -> None:
        announced = from_message.announced_weights(message.data)
        if self._collected < 0:  # the first one of this run
            self._collected = announced.steps
            self._acting.explore_from(announced.steps)
        if announced.version == 0:
            self._acting.residual = None
        else:
            if announced.task != self._task.name:
                raise InputError(
                    f"residual of task {announced.task!r} announced, this cell runs {self._task.name!r}; "
                    "give all nodes one task"
                )
            self._acting.residual = announced_residual(
                announced.file, announced.sha256, self._task.name, self._cell
            )
        self._residual_version = announced.version

    def _answer(self) -> None:
        """Answer once request, model state of the same step, and an image are all there.

        They come on different topics, so their order of arrival is not given.
        """
        request, state = self._request, self._state
        if request is None or state is None:
            return
        if (state.episode, state.step) != (request.episode, request.step):
            return
        if from_message.stamp_ns(state) < self._update_asked_ns:
            return  # a step may have several updates: this is not the last one
        if from_message.stamp_ns(state) > from_message.stamp_ns(request):
            raise InputError("model state is newer than the request that follows it; clocks disagree")
        observation = self._observation(request, state)
        if observation is None:
            return
        self._request = None
        if request.stage == "view":
            self._view(request, state, observation)
        else:
            self._act(request, state, observation)

    def _observation(self, request: Any, state: Any) -> Observation | None:
        """The one that the state was updated with; or, where it was lost on the way here, a newer one."""
        updated_ns, asked_ns = from_message.stamp_ns(state), from_message.stamp_ns(request)
        for one in self._observations:
            if one.stamp_ns == updated_ns or one.stamp_ns >= asked_ns:
                return one
        return None

    def _view(self, request: Any, state: Any, observation: Observation) -> None:
        choice = self._looking.choose(from_state(state), observation)
        self._moves += int(choice.move)
        message = ViewTarget(header=state.header, episode=request.episode, step=request.step)
        message.move = bool(choice.move)
        message.camera_in_world = to_message.pose(choice.camera_in_world)
        message.joint_position = np.asarray(choice.joint_position).tolist()
        message.score, message.present_score = float(choice.score), float(choice.present_score)
        message.visibility = float(choice.visibility)
        message.candidates = int(choice.candidates)
        message.reason = choice.reason
        self._outbox.publish(TARGET, message)

    def _act(self, request: Any, state: Any, observation: Observation) -> None:
        choice = self._acting.choose(from_state(state), observation)
        header = to_message.header(observation.stamp_ns, "world")
        message = ToolAction(header=header, episode=request.episode, step=request.step)
        message.sub_goal = choice.sub_goal
        message.nominal = to_message.vector(choice.nominal)
        message.residual = to_message.vector(choice.residual)
        self._outbox.publish(ACTION, message)
