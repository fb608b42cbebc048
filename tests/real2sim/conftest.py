"""The model, and a world to look at."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from samrl_core.experiments.cell_driver import CellDriver
from samrl_core.model.model import Model
from samrl_core.robots.cell import default_cell
from samrl_core.tasks import task_named
from samrl_core.world.pybullet_world import PyBulletWorld
from tests.torch_threads import one_thread  # noqa: F401 (a fixture)


@pytest.fixture(scope="session")
def model() -> Model:
    """Peg insertion in the default cell."""
    return Model(task_named("peg_insertion"), default_cell())


@pytest.fixture(scope="session")
def driver(model: Model) -> Iterator[CellDriver]:
    """A driver of a world with the default noise; reset it before use."""
    world = PyBulletWorld(model.task, model.cell)
    yield CellDriver(world, model.cell, world.scene.tool)
    world.close()
