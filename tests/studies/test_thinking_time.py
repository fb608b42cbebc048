"""A world goes on while the method thinks, and an episode without that is what it was."""

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.common.errors import InputError
from samrl_core.studies.cell_instances import CONDITIONS
from samrl_core.studies.episodes.world_plant import WorldPlant

TASK, CELL = task_named("spatula_flipping"), cell_named()


def test_the_world_goes_on_between_an_image_and_its_action() -> None:
    """0.25 s of it, before an action of 0.1 s."""
    world = PyBulletWorld(TASK, CELL)
    try:
        plant = WorldPlant(world, TASK, CELL, period_s=0.1, think_s=0.25)
        plant.begin(0)
        began_ns = world.time_ns
        plant.displace_tool(np.array([0.002, 0.0, 0.0]))
        assert world.time_ns - began_ns == 350_000_000
        with pytest.raises(InputError, match="think_s is -1"):
            WorldPlant(world, TASK, CELL, think_s=-1.0)
    finally:
        world.close()


def test_rows_differ_from_the_plain_one_in_time_alone() -> None:
    """Same policy and views; the time stands in the name."""
    plain = CONDITIONS["nominal"].condition
    assert plain.think_s == 0.0
    for name, time_s in (("0.5s", 0.5), ("1s", 1.0), ("2s", 2.0)):
        row = CONDITIONS[f"nominal_thinking_{name}"].condition
        assert row.think_s == time_s and (row.policy, row.strategy) == (plain.policy, plain.strategy)
