"""A pancake can be turned over in this world, by one who is told where it is."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pybullet
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import OCCLUDED_TASKS
from samrl_core.cell.tasks.spatula_flipping.task import PANCAKE, SpatulaFlipping
from samrl_core.cell.world.evaluation import true_values
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.cell.world.settings import NOISELESS
from samrl_core.cell.world.world import Truth
from tests.cell.world.sub_goal_expert import Pace, episodes

CELL = cell_named()
TASK = SpatulaFlipping()
TRUE = partial(true_values, TASK)
FAR = (7, 11)  # seeds of starts 72 mm to the right and 54 mm to the left


def test_expert_turns_the_pancake_over() -> None:
    """Within the actions allowed, gently; it comes to lie against the lip, so a little error remains."""
    for episode in episodes(TASK, CELL, TRUE, range(2), Pace()):
        assert episode.success and episode.done
        assert episode.actions < 60
        assert episode.peak_force < 30.0
        assert episode.error < 0.015


@pytest.mark.thorough
def test_without_a_lip_the_pancake_is_only_pushed() -> None:
    """The same motion, with nothing that stops the pancake: the lip is what turns it."""
    (episode,) = episodes(
        SpatulaFlipping(lip_size=(0.006, 0.240, 0.0005), max_actions=45), CELL, TRUE, [0], Pace()
    )
    assert not episode.success and not episode.done
    assert episode.error > 0.1


@pytest.mark.slow
def test_behind_the_screen_it_matters_where_the_pancake_lies() -> None:
    """It may lie far to the side, and the narrow blade does not turn it over 3 cm off; the plain one does."""

    def off(task: SpatulaFlipping, error: float) -> list[bool]:
        def believed(truth: Truth) -> np.ndarray:
            values = true_values(task, truth)
            return np.array([values[0], values[1] + error, *values[2:]])

        return [episode.success for episode in episodes(task, CELL, believed, FAR, Pace())]

    task = OCCLUDED_TASKS["spatula_flipping_occluded"]
    assert isinstance(task, SpatulaFlipping)
    task = replace(task, max_actions=60)
    assert all(off(task, 0.01))
    assert not any(off(task, 0.03))
    assert all(off(TASK, 0.03))


def test_the_pancake_lies_still_and_slides_with_friction() -> None:
    """At rest it stays; with a speed v it slides v^2 / (2 mu g), mu the geometric mean with the table's."""
    world = PyBulletWorld(TASK, CELL, NOISELESS)
    before = world.truth().body_position[PANCAKE]
    for _ in range(300):
        world.advance()
    rested = world.truth()
    np.testing.assert_allclose(rested.body_position[PANCAKE], before, atol=2e-4)
    assert rested.body_speed[PANCAKE] < 1e-3
    speed = 0.3
    pybullet.resetBaseVelocity(world._bodies.index[PANCAKE], [0.0, speed, 0.0], physicsClientId=world._client)
    for _ in range(400):
        world.advance()
    slid = world.truth().body_position[PANCAKE][1] - rested.body_position[PANCAKE][1]
    assert slid == pytest.approx(speed**2 / (2 * np.sqrt(0.45 * 0.3) * 9.81), rel=0.1)
    world.close()


def test_truth_remembers_how_high_it_was_until_the_next_reset() -> None:
    """Thrown up by 1 m/s it rises 5 cm; a reset forgets that."""
    world = PyBulletWorld(TASK, CELL, NOISELESS)
    start = world.truth().body_position[PANCAKE][2]
    pybullet.resetBaseVelocity(world._bodies.index[PANCAKE], [0.0, 0.0, 1.0], physicsClientId=world._client)
    for _ in range(400):
        world.advance()
    assert world.truth().body_peak_height[PANCAKE] == pytest.approx(start + 1 / (2 * 9.81), rel=0.02)
    world.reset(0)
    assert world.truth().body_peak_height[PANCAKE] == start
    assert world.truth().body_speed[PANCAKE] == 0.0
    world.close()


@pytest.mark.slow
def test_expert_turns_it_over_from_everywhere() -> None:
    """20 starts."""
    found = episodes(TASK, CELL, TRUE, range(20), Pace())
    assert sum(episode.success for episode in found) >= 18
    assert max(episode.peak_force for episode in found) < 30.0


@pytest.mark.slow
def test_a_careless_expert_still_has_a_chance() -> None:
    """A quarter of each action is noise: with sub-goals to come back to, most episodes still succeed."""
    found = episodes(TASK, CELL, TRUE, range(8), Pace(noise=0.25))
    assert sum(episode.success for episode in found) >= 6
