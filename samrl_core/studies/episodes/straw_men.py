"""Episodes without a loop: a belief formed once, or never, and straight steps through its sub-goals.

What succeeds so needs no model that every image corrects, and a table without these rows says little.

- script: one image, a circle or a loose end fitted to what its masks show, and a plate's height (`locate`).
- one_update: one update of the model (eqs. 4 to 7), then blind.
- no_image: what is drawn, and no image at all.

With touch, the script has the loop's own search for the hole, or its own way down to the plate: what is left
of the loop's lead is what its images are worth.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Protocol

import numpy as np

from samrl_core.cell.tasks.spatula_flipping.task import SpatulaFlipping
from samrl_core.cell.tasks.task import SubGoal, Task
from samrl_core.cell.types.observation import Observation
from samrl_core.common.errors import InputError
from samrl_core.model.real2sim.real2sim import initial_estimate
from samrl_core.model.real2sim.tip_offset import TipOffset
from samrl_core.policy.agent.agent import Agent
from samrl_core.policy.agent.episode import ToolMover, Watch, execute_action
from samrl_core.policy.agent.loop import LoopSettings
from samrl_core.policy.contact.insertion import BOTTOM
from samrl_core.policy.contact.surface_touch import SurfaceTouch
from samrl_core.policy.contact.touch_insertion import TouchInsertion, TouchSettings
from samrl_core.studies.episodes.locate import locate_parts, plate_height

STRAW_MEN = ("script", "one_update", "no_image")
REST = LoopSettings.done_confirmations  # images for which everything rests at the end, as in the loop
# Standard deviation per axis of the hole's place from the encoders' tip, as in typical cells (root mean
# square of msgs_docs/results/tasks.md).
SCRIPT_ERROR = 0.002  # [m]
_SPARE = 6  # actions towards a sub-goal beyond those that the straight line takes


class BlindPlant(ToolMover, Protocol):
    """A cell that moves its tool and may take an image."""

    def observe(self) -> Observation:
        """An image and joints of now, with everything at rest."""
        ...

    def tip(self) -> np.ndarray:
        """Tool tip (3,) by the measured joints, in the tool arm's base frame [m]."""
        ...


def run_straw_man(kind: str, agent: Agent, plant: BlindPlant, most: int, watch: Watch) -> bool:
    """One episode of straight steps.

    Args:
        kind: of `STRAW_MEN`.
        agent: lends its task and, for "one_update", its update; its settings say whether to touch.
        plant: what observes and moves.
        most: actions.
        watch: entered around each part, see `run_episode`.

    Returns:
        Whether all sub-goals were passed, which is all that can be known of success without looking.

    Raises:
        InputError: no such kind.
        ReachError: a sub-goal that the arm does not get to.
    """
    if kind not in STRAW_MEN:
        raise InputError(f"no straw man is called {kind!r}; there are: {', '.join(STRAW_MEN)}")
    agent.begin_episode()
    task, values, surface = _belief(kind, agent, plant, watch)
    left = most
    if agent.settings.touch and isinstance(task, SpatulaFlipping):
        surface, left = _feel_surface(task, agent, values, plant, most, watch)
    elif agent.settings.touch:
        return _touch(agent, values, plant, most, watch)
    up = np.array([0.0, 0.0, surface])
    for goal in task.sub_goals(values, plant.tip() - up):
        left -= _approach(replace(goal, tip_position=goal.tip_position + up), plant, left, watch)
        if left == 0:
            break
    for _ in range(REST):
        with watch("observe"):
            plant.observe()
    return left > 0


def _belief(kind: str, agent: Agent, plant: BlindPlant, watch: Watch) -> tuple[Task, np.ndarray, float]:
    """The task and its parameters (P,) that the whole episode goes by, and how high its plate is [m]."""
    task = agent.model.task
    if kind == "no_image":
        return task, np.array([p.nominal for p in task.parameters()]), 0.0
    with watch("observe"):
        observation = plant.observe()
    with watch("update"):
        if kind == "script":
            plate = plate_height(task, observation) if isinstance(task, SpatulaFlipping) else 0.0
            return *locate_parts(task, observation, plant.tip()), plate
        return task, agent.update_model(observation).values, 0.0


def _touch(agent: Agent, values: np.ndarray, plant: BlindPlant, most: int, watch: Watch) -> bool:
    """Insert by touch from a belief that no image corrects; whether the bottom was felt."""
    touch = TouchInsertion(agent.model.task, agent.model.cell, TouchSettings(most_waits=0, sights=False))
    nothing_seen = TipOffset(np.zeros(4), SCRIPT_ERROR**2 * np.eye(4))
    belief = replace(initial_estimate(agent.model), values=values, covariance=1e-8 * np.eye(len(values)))
    for _ in range(most):
        with watch("observe"):
            observation = plant.observe()  # of which the joints are read alone
        move = touch.move(belief, nothing_seen, observation)
        if move.name == BOTTOM:
            return True
        with watch("move"):
            plant.displace_tool(move.displacement)
    return False


def _feel_surface(
    task: SpatulaFlipping, agent: Agent, values: np.ndarray, plant: BlindPlant, most: int, watch: Watch
) -> tuple[float, int]:
    """Height of the surface over the drawn one [m], and how many actions are left."""
    surface, left = SurfaceTouch(task, agent.model.cell), most
    while left:
        with watch("observe"):
            surface.see(plant.observe(), values)  # of which the joints are read alone
        down = surface.move(values, plant.tip())
        if down is None:
            break
        with watch("move"):
            execute_action(plant, down.name, down.displacement)
        left -= 1
    return surface.height, left


def _approach(goal: SubGoal, plant: BlindPlant, most: int, watch: Watch) -> int:
    """Straight steps until the sub-goal is within its tolerance, or too many; how many there were."""
    way = goal.tip_position - plant.tip()
    allowed = min(most, math.ceil(float(np.linalg.norm(way)) / goal.max_step) + _SPARE)
    for steps in range(allowed):
        distance = float(np.linalg.norm(way))
        if distance <= goal.tolerance:
            return steps
        with watch("move"):
            plant.displace_tool(way * min(1.0, goal.max_step / distance))
        way = goal.tip_position - plant.tip()
    return allowed
