"""One planner for all tests: its reachable views are solved once."""

from __future__ import annotations

import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.model.model import Model
from samrl_core.policy.view.view_planning import ViewPlanner
from tests.torch_threads import one_thread  # noqa: F401 (a fixture)


@pytest.fixture(scope="session")
def model() -> Model:
    """Peg insertion in the default cell."""
    return Model(task_named("peg_insertion"), cell_named())


@pytest.fixture(scope="session")
def planner(model: Model) -> ViewPlanner:
    """With its default grid."""
    planner = ViewPlanner(model, model.cell, model.task)
    planner.prepare()
    return planner
