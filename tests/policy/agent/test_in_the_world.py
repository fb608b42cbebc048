"""Algorithm 1 on a PyBullet world, from images to truth's verdict."""

from __future__ import annotations

import pytest

from samrl_core.cell.world.evaluation import ending_now
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.model.model import Model
from samrl_core.policy.agent.agent import Agent
from samrl_core.policy.agent.episode import run_episode
from samrl_core.policy.agent.settings import AgentSettings
from samrl_core.studies.episodes.world_plant import WorldPlant


@pytest.mark.slow
def test_an_episode_of_peg_insertion(model: Model) -> None:
    """The camera moves, the peg goes in, the model says so, and it is true."""
    world = PyBulletWorld(model.task, model.cell)
    plant = WorldPlant(world, model.task, model.cell)
    plant.begin(1)
    agent = Agent(model, AgentSettings(policy="optimised", strategy="best"))
    agent.prepare()
    start = plant.observe().camera_arm.position
    episode = run_episode(agent, plant)
    ending = ending_now(world.truth())
    world.close()
    assert episode.ended == "done" and model.task.succeeded(ending)
    assert 5 < len(episode.steps) <= model.task.max_actions
    assert abs(episode.last.camera_arm.position - start).max() > 0.1
