"""Updated model in, next view and nominal action out (Algorithm 1, lines 4-15).

What the paper learns is computed from the model for now: the view by expected information through the
renderer, the action by a trajectory optimised with sub-goals (eqs. 18-22).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from samrl_msgs.msg import ToolAction, ViewTarget

from samrl_core.errors import InputError, SolveError
from samrl_core.model.model import Model
from samrl_core.robots.cell import default_cell
from samrl_core.robots.robot import ROLES
from samrl_core.tasks import task_named
from samrl_core.trajectory import TrajectorySettings, optimise
from samrl_core.types.observation import ArmReading
from samrl_core.view_planning import ViewChoice, ViewPlanner
from samrl_ros.behaviour import Behaviour, Outbox
from samrl_ros.conversions import from_message, to_message
from samrl_ros.conversions.model_state import from_state
from samrl_ros.settings import setting
from samrl_ros.topics import arm_topic, cell_topic

READY, REQUEST = cell_topic("sim_bridge/ready"), cell_topic("supervisor/request")
STATE = cell_topic("model_updater/state")
TARGET, ACTION = cell_topic("view_planner/target"), cell_topic("view_planner/nominal_action")
JOINTS = {arm_topic(role, "joint_states"): role for role in ROLES}


@dataclass(frozen=True)
class ViewPlannerSettings:
    """Settings of `view_planner`."""

    task: str = setting("peg_insertion", "task whose scene the model holds")
    strategy: str = setting("best", "how the view is chosen", choices=("best", "fixed", "random"))
    seed: int = setting(0, "seed of the random strategy", range=(0, 2**31 - 1))
    horizon: int = setting(
        3, "sub-goals that are planned for; only the first action is executed", range=(1, 60)
    )


class ViewPlannerNode(Behaviour):
    """Answers "view" and "act" requests from the newest model state and joint readings."""

    name = "view_planner"
    inputs = (READY, REQUEST, STATE, *JOINTS)
    outputs = (TARGET, ACTION)

    def __init__(self, settings: ViewPlannerSettings, outbox: Outbox) -> None:
        self._settings = settings
        self._outbox = outbox
        self._task = task_named(settings.task)
        cell = default_cell()
        self._cell = cell
        self._parameters = tuple(spec.name for spec in self._task.parameters())
        self._model = Model(self._task, cell)
        self._planner = ViewPlanner(self._model, cell, self._task)
        self._horizon = TrajectorySettings(max_sub_goals=settings.horizon, max_iterations=3, spare_actions=1)
        self._rng = np.random.default_rng(settings.seed)
        self._state: Any = None
        self._request: Any = None
        self._readings: dict[str, ArmReading] = {}
        self._moves = 0

    def start(self) -> None:
        """See `Behaviour`: reachable views and compiled physics are there before the first request."""
        self._planner.prepare()
        self._model.dynamics.prepare()

    def handle(self, topic: str, message: Any) -> None:
        """See `Behaviour`."""
        if topic in JOINTS:
            role = JOINTS[topic]
            self._readings[role] = from_message.arm_reading(message, self._cell.arm(role).joint_names)
        elif topic == READY:
            self._state = self._request = None
        elif topic == STATE:
            from_message.model_values(message, self._parameters)  # refused on arrival, not when it is used
            self._state = message
        elif message.stage in ("view", "act"):
            self._request = message
        self._answer()

    def status(self) -> dict[str, str]:
        """See `Behaviour`."""
        return {"views_chosen": str(self._moves), "strategy": self._settings.strategy}

    def _answer(self) -> None:
        """Answer once request, model state of the same step, and fresh joint readings are all there.

        They come on different topics, so their order of arrival is not given.
        """
        request, state = self._request, self._state
        if request is None or state is None or len(self._readings) < len(ROLES):
            return
        if (state.episode, state.step) != (request.episode, request.step):
            return
        asked_ns = from_message.stamp_ns(request)
        if from_message.stamp_ns(state) > asked_ns:
            raise InputError("model state is newer than the request that follows it; clocks disagree")
        if any(reading.stamp_ns < asked_ns for reading in self._readings.values()):
            return
        self._request = None
        if request.stage == "view":
            self._view(request, state)
        else:
            self._act(request, state)

    def _view(self, request: Any, state: Any) -> None:
        choice: ViewChoice = self._planner.plan(
            from_state(state),
            self._readings["tool_arm"].position,
            self._readings["camera_arm"].position,
            strategy=self._settings.strategy,
            rng=self._rng,
        )
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

    def _act(self, request: Any, state: Any) -> None:
        values = np.array(state.values)
        tip = self._model.tip_in_base(self._readings["tool_arm"].position).position
        message = ToolAction(header=state.header, episode=request.episode, step=request.step)
        message.sub_goal, nominal = self._action(values, tip)
        message.nominal = to_message.vector(nominal)
        self._outbox.publish(ACTION, message)

    def _action(self, values: np.ndarray, tip: np.ndarray) -> tuple[str, np.ndarray]:
        """Name of the next sub-goal, and the first action (3,) [m] towards it; "none" and 0 when done."""
        dynamics = self._model.dynamics
        try:
            plan = optimise(dynamics, self._task, dynamics.start(values, tip), self._horizon)
        except SolveError as error:
            self._outbox.log("error", f"no plan, straight to the next sub-goal instead: {error}")
            goals = self._task.sub_goals(values, tip)
            if not goals:
                return "none", np.zeros(3)
            way = goals[0].tip_position - tip
            return goals[0].name, way * min(1.0, goals[0].max_step / max(float(np.linalg.norm(way)), 1e-9))
        if not plan.sub_goals:
            return "none", np.zeros(3)
        return plan.sub_goals[0], plan.actions[0]
