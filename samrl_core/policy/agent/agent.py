"""The parts of Algorithm 1 on one model, and its loop."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from samrl_core.cell.types.observation import Observation
from samrl_core.model.model import Model
from samrl_core.model.real2sim.real2sim import Estimate
from samrl_core.policy.agent.acting import Acting, ActionChoice
from samrl_core.policy.agent.looking import Looking
from samrl_core.policy.agent.loop import LoopSettings, LoopState, Stage, stage_after_update
from samrl_core.policy.agent.settings import AgentSettings, Tell, silent
from samrl_core.policy.agent.updating import Updating
from samrl_core.policy.view.sensing_value import Networks

Part = Literal["observe", "update", "view", "look", "act", "move"]
Watch = Callable[[Part], AbstractContextManager[None]]  # is entered around each part of an episode


def unwatched(part: Part) -> AbstractContextManager[None]:
    """Nobody watches."""
    return nullcontext()


class Agent:
    """Updates, looks and acts."""

    def __init__(
        self,
        model: Model,
        settings: AgentSettings | None = None,
        networks: Networks | None = None,
        tell: Tell = silent,
    ) -> None:
        """`networks` where the settings need them, as from `trained_networks`.

        Raises:
            InputError: they are needed and not there.
        """
        self.model, self.settings = model, settings or AgentSettings()
        self.updating = Updating(model, self.settings.update, tell)
        self.looking = Looking(model, self.settings, networks)
        self.acting = Acting(model, self.settings, networks, tell)

    def prepare(self) -> None:
        """Compile and solve what the first step would wait for."""
        self.updating.prepare()
        self.looking.prepare()
        self.acting.prepare()


class Plant(Protocol):
    """A cell as Algorithm 1 needs it: nothing but sensors and motions."""

    def observe(self) -> Observation:
        """Cam(P): an image and joints of now, with everything at rest."""
        ...

    def look_from(self, camera_arm_position: np.ndarray, /) -> None:
        """Move the camera arm there (J,) [rad] and wait until it rests."""
        ...

    def displace_tool(self, displacement: np.ndarray, /) -> None:
        """Move the tool's tip (3,) in the tool arm's base frame [m] and wait until it rests."""
        ...


@dataclass(frozen=True, eq=False)
class Step:
    """One action of an episode, as line 20 stores it."""

    observation: Observation  # before the action
    estimate: Estimate  # line 16's data: states that the model was in
    choice: ActionChoice


@dataclass(frozen=True, eq=False)
class Episode:
    """What `run_episode` did."""

    steps: tuple[Step, ...]
    last: Observation
    estimate: Estimate  # after the last update
    ended: Stage  # "done": as the model believes; truth is for evaluation to ask


def run_episode(
    agent: Agent, plant: Plant, settings: LoopSettings | None = None, watch: Watch = unwatched
) -> Episode:
    """Algorithm 1 from line 1 on, until the model believes by two images that the task is done, or a limit.

    `watch` sees the parts: "observe", "look" and "move" are the plant's, the others the agent's.
    """
    task = agent.model.task
    loop = settings or LoopSettings(task.max_actions, believe=agent.settings.update)
    agent.updating.begin()
    agent.acting.begin()
    state = LoopState()
    steps: list[Step] = []
    while True:
        with watch("observe"):
            observation = plant.observe()
        with watch("update"):
            estimate = agent.updating.update(observation)
        state = state.updated(estimate.why_stopped, estimate.loss_after)
        tip = agent.model.tip_in_base(observation.tool_arm.position).position
        stage = stage_after_update(task, estimate.values, tip, state, loop)
        if stage == "again":
            state = state.agreed_once()
            continue
        if stage == "view":
            with watch("view"):
                view = agent.looking.choose(estimate, observation)
            if view.move:
                with watch("look"):
                    plant.look_from(view.joint_position)
                state = state.looked_once()
                continue
            stage = "act"
        if stage != "act":
            return Episode(tuple(steps), observation, estimate, stage)
        with watch("act"):
            choice = agent.acting.choose(estimate, observation)
        with watch("move"):
            plant.displace_tool(choice.displacement)
        steps.append(Step(observation, estimate, choice))
        state = state.acted()
