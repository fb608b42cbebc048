"""A thread that hangs in its eye is not pulled out because of what one image shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.tasks.needle_threading.task import NeedleThreading
from samrl_core.model.model import Model
from samrl_core.model.real2sim.held import held_inside
from samrl_core.model.real2sim.real2sim import Estimate, initial_estimate

NAMED = task_named("needle_threading_hard")
assert isinstance(NAMED, NeedleThreading)
TASK: NeedleThreading = NAMED
CLEARANCE = 0.002  # radius of the eye less that of the thread [m]


@pytest.fixture(scope="module")
def inside() -> tuple[Estimate, np.ndarray]:
    """A straight thread whose end hangs 13 mm below its eye, and the tip."""
    before = initial_estimate(Model(TASK, cell_named()))
    tip = np.array([0.5, 0.0, 0.0])
    points = TASK.thread_points(before.values, tip)
    return before, tip + [0.0, 0.0, 0.12 - 0.013 - points[-1, 2]]


def shown(before: Estimate, aside: float, deviation: float) -> Estimate:
    """As if an image showed the needle so far aside in x [m], by that deviation."""
    values = before.values.copy()
    values[20] += aside
    spread = np.full(len(values), 1e-4)
    spread[20] = deviation
    return replace(before, values=values, covariance=np.diag(spread**2), converged=False)


def test_an_image_that_leaves_it_open_does_not_show_a_held_thread_outside(
    inside: tuple[Estimate, np.ndarray],
) -> None:
    """The eye 5 mm aside by a view that tells it to 3 mm: the thread went up again, out of the eye."""
    before, tip = inside
    after = held_inside(TASK, before, shown(before, 0.005, 0.003), tip)
    assert np.linalg.norm(TASK.aim(after.values, tip)) < CLEARANCE
    assert after.covariance[20, 20] < 0.0015**2
    assert np.linalg.eigvalsh(after.covariance).min() > 0.0
    assert TASK.sub_goals(after.values, tip)[0].name.startswith("thread_")


def test_an_image_that_is_sure_is_believed(inside: tuple[Estimate, np.ndarray]) -> None:
    before, tip = inside
    sure = shown(before, 0.006, 0.0003)
    assert held_inside(TASK, before, sure, tip) is sure


def test_what_is_within_its_play_stays(inside: tuple[Estimate, np.ndarray]) -> None:
    before, tip = inside
    near = shown(before, 0.0015, 0.003)
    assert held_inside(TASK, before, near, tip) is near


def test_an_end_that_has_not_gone_in_is_held_by_nothing(inside: tuple[Estimate, np.ndarray]) -> None:
    before, tip = inside
    aside = shown(before, 0.005, 0.003)
    for way in ([0.0, 0.0, 0.011], [0.006, 0.0, 0.0]):  # 2 mm deep, and beside the eye
        assert held_inside(TASK, before, aside, tip + way) is aside
