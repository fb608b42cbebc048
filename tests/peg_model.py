"""One model of peg insertion for all tests of a run; the conftest of each folder that wants it imports it."""

from __future__ import annotations

import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.model.model import Model


@pytest.fixture(scope="session")
def model() -> Model:
    """Peg insertion in the default cell."""
    return Model(task_named("peg_insertion"), cell_named())
