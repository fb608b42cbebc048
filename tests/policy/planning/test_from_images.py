"""The loop of update, prediction and plan solves the tasks from images, without ROS."""

from __future__ import annotations

import pytest

from samrl_core.cell.tasks import TASKS
from tests.policy.planning.from_images import solve


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(TASKS))
def test_solves_from_images(name: str) -> None:
    """One start, to the end; the model says done when it is."""
    outcome = solve(name, 1)
    print(name, outcome)
    assert outcome.success and outcome.detected
