"""One model of peg insertion for all tests, and one thread: small networks gain nothing from two."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
import torch

from samrl_core.model.model import Model
from samrl_core.robots.cell import default_cell
from samrl_core.tasks import task_named


@pytest.fixture(scope="session", autouse=True)
def one_thread() -> Iterator[None]:
    """Torch's threads wait for each other at every small image on a busy machine."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture(scope="session")
def model() -> Model:
    """Peg insertion in the default cell."""
    return Model(task_named("peg_insertion"), default_cell())
