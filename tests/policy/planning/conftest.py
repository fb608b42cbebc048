"""One planner for all tests: its reachable views are solved once."""

from __future__ import annotations

import pytest

from samrl_core.model.model import Model
from samrl_core.policy.view.view_planning import ViewPlanner


@pytest.fixture(scope="session")
def planner(model: Model) -> ViewPlanner:
    """With its default grid."""
    planner = ViewPlanner(model, model.cell, model.task)
    planner.prepare()
    return planner
