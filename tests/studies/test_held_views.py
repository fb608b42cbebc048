"""Views that are held: which, how the arm gets there, and how the best is found."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.pose import Pose
from samrl_core.policy.view.view_reach import ViewReach
from samrl_core.studies.paper.table1.held_views import HeldView, held_views, ranked_views, spread_views

TASK, CELL = task_named("peg_insertion"), cell_named()


@pytest.fixture(scope="module")
def views() -> tuple[HeldView, ...]:
    return held_views(TASK, CELL)


@pytest.mark.thorough
def test_the_arm_gets_there_and_is_in_nobodys_way(views: tuple[HeldView, ...]) -> None:
    """From the start by each stop to the view, clear of the tool arm; straight ways reach fewer."""
    reach, start = ViewReach(CELL, TASK), TASK.start_joints(CELL)
    nominal = np.array([p.nominal for p in TASK.parameters()])
    tool = reach.tool_capsules(start["tool_arm"], nominal)
    straight = [view for view in views if len(view.way) == 1]
    assert 8 <= len(straight) < len(views)
    for view in views:
        reached = reach.camera_at(view.way[-1])
        np.testing.assert_allclose(reached.position, view.camera_in_world.position, atol=1e-9)
        assert reached.angle_to(view.camera_in_world) < 1e-9
        assert reach.is_clear(reach.camera_capsules(view.way[-1]), tool)
        stops = (start["camera_arm"], *view.way)
        assert all(reach.way_is_clear(a, b, tool) for a, b in zip(stops[:-1], stops[1:], strict=True))


def test_views_are_spread() -> None:
    """Two heaps of places and one apart: three views, one of each."""
    sites = [[0.0, 0, 0], [0.01, 0, 0], [1, 0, 0], [1.01, 0, 0], [0.5, 2, 0]]
    level = np.array([0.0, 0.0, 0.0, 1.0])
    views = [HeldView(Pose(np.array(p, dtype=float), level), ()) for p in sites]
    chosen = spread_views(views, 3)
    assert 4 in chosen and len(chosen) == 3 and len({i // 2 for i in chosen}) == 3
    assert spread_views(views, 9) == [0, 1, 2, 3, 4]


def test_the_best_view_succeeds_most_then_acts_least() -> None:
    def case(view: int, success: bool, actions: int) -> dict[str, object]:
        return {"view": view, "success": success, "actions": actions}

    rounds = [case(v, v != 2, 30 - v) for v in (1, 2, 3, 5) for _ in range(2)]
    assert ranked_views(rounds) == [5, 3, 1, 2]
    assert ranked_views([*rounds, *(case(v, True, 50) for v in (1, 2))]) == [1, 2]  # alone tried as often
