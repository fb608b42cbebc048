"""How far off a loop with touch believes the hole when it starts down to it, and what it states.

`python -m tests.policy.contact.gap_accuracy 20 21` prints a line for each development cell `typical:20` and
so on, and root mean squares. `MemorySettings.unknown` rests on it.
"""

from __future__ import annotations

import sys

import numpy as np
import torch

from samrl_core.cell.instance.cell_instance import instance_named
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.world.evaluation import true_values
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.model.model import Model
from samrl_core.policy.agent.agent import Agent
from samrl_core.policy.agent.settings import AgentSettings
from samrl_core.studies.episodes.world_plant import WorldPlant

CELL, TASK, SEED = cell_named(), task_named("peg_insertion_hard"), 5
SETTINGS = AgentSettings(policy="optimised", strategy="fixed", tip_offset=True, touch=True)


def measure(agent: Agent, instance: str) -> tuple[np.ndarray, np.ndarray]:
    """Error (2,) of the hole's place from the tip, and its stated deviation (2,) [m]."""
    agent.restart(SETTINGS)
    world = PyBulletWorld(TASK, CELL, instance=instance_named(instance, CELL))
    plant = WorldPlant(world, TASK, CELL)
    plant.begin(SEED)
    while True:
        observation, truth = plant.observe(), world.truth()
        choice = agent.act(agent.update_model(observation), observation)
        if choice.sub_goal not in ("feel", "above"):
            break
        plant.displace_tool(choice.displacement)
    world.close()
    assert agent._touch is not None and agent._tip_offset is not None
    mouth = agent._touch.mouth(agent._tip_offset)
    encoders = agent.model.tip_in_base(observation.tool_arm.position).position
    gap = true_values(TASK, truth)[:2] - truth.tip_position[:2]
    return mouth.place - encoders[:2] - gap, np.sqrt(np.diag(mouth.covariance))


if __name__ == "__main__":
    torch.set_num_threads(1)
    np.set_printoptions(precision=2, suppress=True)
    agent, found = Agent(Model(TASK, CELL), SETTINGS), []
    for number in sys.argv[1:]:
        found.append(measure(agent, f"typical:{number}"))
        print(number, *(1e3 * part for part in found[-1]), "mm", flush=True)
    print(
        "root mean square",
        *(1e3 * np.sqrt(np.mean(np.square(one), axis=0)) for one in zip(*found, strict=True)),
    )
