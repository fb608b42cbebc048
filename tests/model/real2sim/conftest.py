"""The model, and a world to look at."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.model.model import Model
from samrl_core.studies.episodes.cell_driver import CellDriver


@pytest.fixture(scope="session")
def driver(model: Model) -> Iterator[CellDriver]:
    """A driver of a world with the default noise; reset it before use."""
    world = PyBulletWorld(model.task, model.cell)
    yield CellDriver(world, model.cell, world.scene.tool)
    world.close()
