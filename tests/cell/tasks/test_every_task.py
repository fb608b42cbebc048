"""What holds for every task: its longest action, and how starts are drawn."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.tasks import EVERY_TASK
from samrl_core.cell.tasks.task import Task

EVERY = pytest.mark.parametrize("task", EVERY_TASK.values(), ids=lambda task: task.name)


def start_tip(task: Task) -> np.ndarray:
    """Near where every task begins: over the middle of the first sub-goals [m]."""
    nominal = np.array([p.nominal for p in task.parameters()])
    return task.sub_goals(nominal, np.array([0.5, 0.0, 0.3]))[0].tip_position + [0.0, 0.0, 0.05]


@EVERY
def test_the_longest_action_is_that_of_the_largest_sub_goal(task: Task) -> None:
    """From everywhere about the start, over all that lies ahead; and the limit is not larger than needed."""
    rng = np.random.default_rng(0)
    steps = []
    for _ in range(50):
        tip = start_tip(task) + rng.uniform(-0.06, 0.06, 3)
        steps += [goal.max_step for goal in task.sub_goals(task.start_values(rng), tip)]
    assert max(steps) == task.action_limit


@EVERY
def test_a_draw_shows_the_starts_own_values(task: Task) -> None:
    """The world's draw and the learner's start are the same for the same seed."""
    values = task.start_values(np.random.default_rng(3))
    draw = task.sample_start(np.random.default_rng(3))
    np.testing.assert_allclose(task.values_at(draw.body_in_world, draw.chain_angles), values, atol=1e-12)
    lower, upper = (np.array([getattr(p, n) for p in task.parameters()]) for n in ("lower", "upper"))
    assert (values >= lower).all() and (values <= upper).all()
    assert not task.is_done(values, start_tip(task))
