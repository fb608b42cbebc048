"""One model of peg insertion for all tests, and one thread: small networks gain nothing from two."""

from __future__ import annotations

import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.model.model import Model
from tests.torch_threads import one_thread  # noqa: F401 (a fixture)


@pytest.fixture(scope="session")
def model() -> Model:
    """Peg insertion in the default cell."""
    return Model(task_named("peg_insertion"), cell_named())
