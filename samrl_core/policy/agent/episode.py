"""An episode of Algorithm 1 in the library, on whatever observes and moves."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from samrl_core.cell.control.touch_stop import TOUCH_DOWN
from samrl_core.cell.types.observation import Observation
from samrl_core.model.real2sim.real2sim import Estimate
from samrl_core.policy.agent.agent import ActionChoice, Agent
from samrl_core.policy.agent.loop import LoopSettings, LoopState, Stage, stage_after_update

Part = Literal["observe", "update", "view", "look", "act", "move"]
Watch = Callable[[Part], AbstractContextManager[None]]  # is entered around each part of an episode


def unwatched(part: Part) -> AbstractContextManager[None]:
    """No measurement."""
    return nullcontext()


class ToolMover(Protocol):
    """What moves a tool."""

    def displace_tool(self, displacement: np.ndarray, /) -> None:
        """Move the tool's tip (3,) in the tool arm's base frame [m] and wait until it rests."""
        ...

    def touch_down(self, displacement: np.ndarray, /) -> None:
        """The same for `TOUCH_DOWN`: slowly, and only until it touches, see `TouchStop`."""
        ...


class Plant(ToolMover, Protocol):
    """A cell as Algorithm 1 needs it: nothing but sensors and motions."""

    def observe(self) -> Observation:
        """Cam(P): an image and joints of now, with everything at rest."""
        ...

    def move_camera(self, camera_arm_position: np.ndarray, /) -> None:
        """Move the camera arm there (J,) [rad] and wait until it rests."""
        ...


@dataclass(frozen=True, eq=False)
class Step:
    """One action of an episode, as line 20 stores it."""

    observation: Observation  # before the action
    estimate: Estimate  # line 16's data: states that the model was in
    choice: ActionChoice


@dataclass(frozen=True, eq=False)
class Episode:
    """Result of `run_episode`."""

    steps: tuple[Step, ...]
    last: Observation
    estimate: Estimate  # after the last update
    ended: Stage  # "done": by model and joints; truth is for evaluation to ask


def execute_action(mover: ToolMover, sub_goal: str, displacement: np.ndarray) -> None:
    """Move the tip by (3,) [m] as an action towards a sub-goal is moved, guarded or not."""
    (mover.touch_down if sub_goal == TOUCH_DOWN else mover.displace_tool)(displacement)


def run_episode(
    agent: Agent, plant: Plant, settings: LoopSettings | None = None, watch: Watch = unwatched
) -> Episode:
    """Algorithm 1 from line 1 on, until consecutive updates report success, or a limit.

    `watch` is entered around each part: "observe", "look" (the camera moves) and "move" are the plant's, the
    others the agent's.
    """
    task = agent.model.task
    loop = settings or LoopSettings(task.max_actions, stop_on_model_success=agent.settings.update)
    agent.begin_episode()
    state = LoopState()
    steps: list[Step] = []
    while True:
        with watch("observe"):
            observation = plant.observe()
        with watch("update"):
            estimate = agent.update_model(observation)
        state = state.updated(estimate.why_stopped, estimate.loss_after)
        tip = agent.tip(observation)
        stage = stage_after_update(task, estimate.values, tip, state, loop)
        if stage == "again":
            state = state.confirmed_once()
            continue
        if stage == "retake":
            state = state.retaken_once()
            continue
        if stage == "view":
            with watch("view"):
                view = agent.plan_view(estimate, observation)
            if view.move:
                with watch("look"):
                    plant.move_camera(view.joint_position)
                state = state.view_searched()
                continue
            stage = "act"
        if stage == "done" and agent.pressed_too_hard(observation):
            stage = "forced"
        if stage != "act":
            return Episode(tuple(steps), observation, estimate, stage)
        with watch("act"):
            choice = agent.act(estimate, observation)
        with watch("move"):
            execute_action(plant, choice.sub_goal, choice.displacement)
        steps.append(Step(observation, estimate, choice))
        state = state.acted()
