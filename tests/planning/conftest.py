"""One planner for all tests: its reachable views are solved once."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
import torch

from samrl_core.model.model import Model
from samrl_core.robots.cell import default_cell
from samrl_core.tasks import task_named
from samrl_core.view_planning import ViewPlanner


@pytest.fixture(scope="session", autouse=True)
def one_thread() -> Iterator[None]:
    """Torch's threads wait for each other at every small image: on a busy machine that is 20 times slower."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture(scope="session")
def model() -> Model:
    """Peg insertion in the default cell."""
    return Model(task_named("peg_insertion"), default_cell())


@pytest.fixture(scope="session")
def planner(model: Model) -> ViewPlanner:
    """With its default grid."""
    planner = ViewPlanner(model, model.cell, model.task)
    planner.prepare()
    return planner
