"""Episodes in a world that differs from the model, each known by its order: in a process of its own or here.

The model's verdict is the reward, the truth is asked for once an episode has ended, and only counted.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch

from samrl_core.cell.instance.cell_instance import instance_named
from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.observation import Observation
from samrl_core.cell.world.evaluation import evaluate_now
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.common.errors import ReachError, SamrlError
from samrl_core.learning.residual.replay import End, ReplayStep
from samrl_core.model.model import Model
from samrl_core.policy.agent.agent import Agent
from samrl_core.policy.agent.episode import Episode, run_episode
from samrl_core.policy.agent.loop import LoopSettings
from samrl_core.policy.agent.policies import STRATEGY_OF, TOUCH
from samrl_core.policy.agent.settings import AgentSettings, trained_networks
from samrl_core.policy.networks.networks import ResidualActor
from samrl_core.policy.view.sensing_value import Networks
from samrl_core.studies.episodes.differing_world import differing_world
from samrl_core.studies.episodes.world_plant import WorldPlant

# ASSUMPTION: of the task's actions; one that goes well takes about half of them. More real steps would go
# into what is stuck, and success within fewer actions is never more than within all.
SHARE_OF_ACTIONS = 0.4
ENDS = {"done": End.SUCCESS, "action_limit": End.FAILURE}  # other ends carry no reward


@dataclass(frozen=True)
class EpisodeSite:
    """Which world, and which nominal policy acts in it."""

    task: str
    policy: str  # of `samrl_core.policy.agent.policies.RUN_POLICIES`
    weights: Path | None  # folder of trained networks, None: the package's
    offset: tuple[float, float, float]  # of the camera arm's base from where calibration has it, in world [m]
    cell: str = DEFAULT_CELL  # that the policy knows
    instance: str = ""  # that the world is in place of `differing_world`, which takes the offset

    @property
    def name(self) -> str:
        """Of its task and, where it is one, its cell instance; for keys and folders."""
        return f"{self.task}-{self.instance.replace(':', '-')}" if self.instance else self.task

    @property
    def max_actions(self) -> int:
        """Of an episode here; a cell instance's has as many as the task allows."""
        share = 1.0 if self.instance else SHARE_OF_ACTIONS
        return round(share * task_named(self.task).max_actions)


@dataclass(frozen=True, eq=False)
class Order:
    """One episode."""

    site: EpisodeSite
    seed: int  # of the scene and the sensors
    max_actions: int
    residual: dict[str, np.ndarray]  # weights of the actor by name; empty is the zero residual
    limit: float  # of the residual [m]
    exploration: float = 0.0  # standard deviation per axis [m]
    memory: float = 0.0  # of the exploration from action to action
    noise_seed: int = 0  # of the exploration


@dataclass(frozen=True, eq=False)
class Played:
    """What came of it."""

    steps: tuple[ReplayStep, ...]  # their episode is 0
    ended: str  # the loop's end, or "error"
    why: str  # of an error
    success: bool  # by the truth
    final_error: float  # by the truth [m]

    @property
    def end(self) -> End:
        """For the replay."""
        return ENDS.get(self.ended, End.CUT)


Play = Callable[[Sequence[Order]], list[Played]]  # episodes in the order that was asked for


class Stage:
    """An agent kept from episode to episode; each episode has a world of its own, so that it is the same
    whichever process runs it.
    """

    def __init__(self, site: EpisodeSite) -> None:
        """Builds the model and compiles what the agent needs, whatever world the site has."""
        self._cell, self._task = cell_named(site.cell), task_named(site.task)
        touch = site.policy == TOUCH
        self._settings = AgentSettings(
            policy="optimised" if touch else site.policy,
            strategy=STRATEGY_OF[site.policy],
            tip_offset=touch,
            touch=touch,
        )
        networks: Networks | None = None
        if self._settings.needs_networks:
            networks = trained_networks(site.task, self._cell, site.weights)
        self._model = Model(self._task, self._cell)
        self._agent = Agent(self._model, self._settings, networks)
        self._agent.prepare()

    def play(self, order: Order) -> Played:
        """One episode from its scene on."""
        self._agent.restart(self._exploring(order), _residual(order))
        world = self._world_of(order.site)
        plant = _PatientPlant(WorldPlant(world, self._task, self._cell))
        plant.begin(order.seed)
        steps: tuple[ReplayStep, ...] = ()
        ended, why = "error", ""
        try:
            episode = run_episode(self._agent, plant, LoopSettings(order.max_actions))
            steps, ended = self._steps(episode), episode.ended
        except SamrlError as error:
            why = str(error)
        outcome = evaluate_now(world, self._task)
        world.close()
        return Played(steps, ended, why, outcome.success, outcome.final_error)

    def _world_of(self, site: EpisodeSite) -> PyBulletWorld:
        if not site.instance:
            return differing_world(self._task, self._cell, site.offset)
        return PyBulletWorld(self._task, self._cell, instance=instance_named(site.instance, self._cell))

    def _exploring(self, order: Order) -> AgentSettings:
        return replace(
            self._settings,
            seed=order.noise_seed,
            exploration=order.exploration,
            exploration_memory=order.memory,
            exploration_limit=order.limit,
        )

    def _steps(self, episode: Episode) -> tuple[ReplayStep, ...]:
        observations = [step.observation for step in episode.steps] + [episode.last]
        tips = [self._model.tip_in_base(one.tool_arm.position).position for one in observations]
        return tuple(
            ReplayStep(
                0,
                index,
                step.observation.frame.color,
                step.observation.frame.depth,
                step.observation.camera.camera_in_world,
                tips[index],
                step.choice.nominal,
                step.choice.residual,
                tips[index + 1] - tips[index],
            )
            for index, step in enumerate(episode.steps)
        )


def _residual(order: Order) -> ResidualActor | None:
    if not order.residual:
        return None
    actor = ResidualActor(order.limit)
    actor.load_state_dict({name: torch.from_numpy(array) for name, array in order.residual.items()})
    return actor.eval().requires_grad_(False)


@lru_cache(maxsize=3)  # the tasks that share a process
def _stage(site: EpisodeSite) -> Stage:
    return Stage(site)


def play(order: Order) -> Played:
    """One episode, on the stage that this process holds for all worlds of its task and policy."""
    return _stage(replace(order.site, offset=(0.0, 0.0, 0.0), instance="")).play(order)


class _PatientPlant:
    """A world's plant that stands still where the arm cannot go: the action is used up, not the episode."""

    def __init__(self, plant: WorldPlant) -> None:
        self._plant = plant

    def begin(self, seed: int) -> None:
        self._plant.begin(seed)

    def observe(self) -> Observation:
        return self._plant.observe()

    def move_camera(self, camera_arm_position: np.ndarray) -> None:
        self._plant.move_camera(camera_arm_position)

    def displace_tool(self, displacement: np.ndarray) -> None:
        self._try(self._plant.displace_tool, displacement)

    def touch_down(self, displacement: np.ndarray) -> None:
        self._try(self._plant.touch_down, displacement)

    def _try(self, move: Callable[[np.ndarray], None], displacement: np.ndarray) -> None:
        try:
            move(displacement)
        except ReachError:
            self._plant.observe()
