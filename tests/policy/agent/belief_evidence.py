"""What the first images of a hard thread's episode say of their cell: calibrated, or not.

`python -m tests.policy.agent.belief_evidence typical:0 careless:0 ...` prints a line per cell: evidence for
the wider belief after each image, natural logarithm, and whether it rules the rest of the episode.
"""

from __future__ import annotations

import sys

from samrl_core.cell.instance.cell_instance import instance_named
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.observation import Observation
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.common.streams import DEVELOPMENT, TEST, seed_of
from samrl_core.model.model import Model
from samrl_core.model.real2sim.real2sim import Estimate
from samrl_core.model.scene.settings import ModelSettings
from samrl_core.policy.agent.agent import Agent
from samrl_core.policy.agent.beliefs import BeliefChoice, ChoiceSettings
from samrl_core.policy.agent.episode import run_episode
from samrl_core.policy.agent.settings import AgentSettings
from samrl_core.studies.cell_instances import PER_INSTANCE
from samrl_core.studies.episodes.world_plant import WorldPlant

TASK = "needle_threading_hard"


class Enough(Exception):
    """The images that may choose are over."""


class Asked(Agent):
    """An agent that ends its episode when the belief is chosen."""

    def update_model(self, observation: Observation) -> Estimate:
        """See `Agent`."""
        found = super().update_model(observation)
        choice: BeliefChoice = self._beliefs
        print(f"{choice.evidence:6.1f}", end="", flush=True)
        self.asked = getattr(self, "asked", 0) + 1
        if choice.uncalibrated or self.asked >= ChoiceSettings().images:
            raise Enough
        return found


def main() -> None:
    """A line per cell, for its first episode in `samrl experiment cell_instances`."""
    cell, task = cell_named(), task_named(TASK)
    model = Model(task, cell, ModelSettings(threads=1))
    for name in sys.argv[1:]:
        _, *purpose, number = name.split(":")
        stream = TEST if "test" in purpose else DEVELOPMENT
        seed = seed_of(int(number) * PER_INSTANCE, "episode", stream, TASK)
        agent = Asked(model, AgentSettings(policy="optimised", strategy="best", seed=seed))
        world = PyBulletWorld(task, cell, instance=instance_named(name, cell))
        plant = WorldPlant(world, task, cell)
        plant.begin(seed)
        print(f"{name}:", end="", flush=True)
        try:
            run_episode(agent, plant)
        except Enough:
            print(" uncalibrated" if agent.uncalibrated else " as usual", flush=True)
        world.close()


if __name__ == "__main__":
    main()
