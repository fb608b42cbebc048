"""A view lasts only where the tool arm does not come on its way to the sub-goals."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.robots.geometry import Capsules, clearance
from samrl_core.cell.tasks import task_named
from samrl_core.model.model import Model
from samrl_core.model.real2sim.real2sim import initial_estimate
from samrl_core.policy.view.view_planning import ViewPlanner
from samrl_core.policy.view.view_reach import ViewReach

CELL = cell_named()
TASK = task_named("spatula_flipping_hard")
VALUES = np.array([p.nominal for p in TASK.parameters()])
TOOL = TASK.start_joints(CELL)["tool_arm"]


def test_the_way_leads_through_the_sub_goals() -> None:
    reach = ViewReach(CELL, TASK)
    tip = Model(TASK, CELL).tip_in_base(TOOL).position
    last = TASK.sub_goals(VALUES, tip)[-1].tip_position
    point = Capsules(last[None], last[None], np.array([1e-3]))
    assert clearance(point, reach.tool_capsules(TOOL, VALUES)) > 0.05
    assert clearance(point, reach.way_capsules(TOOL, VALUES)) < 0.01


def test_a_camera_in_the_way_goes_where_the_arm_does_not_come() -> None:
    model = Model(TASK, CELL)
    reach = ViewReach(CELL, TASK)
    coming = reach.way_capsules(TOOL, VALUES)
    free = reach.clear_views(reach.obstacles(TOOL, VALUES))
    inside = [view for view in free if not reach.is_clear(view.capsules, coming)]
    assert inside, "no view stands in the way: the test says nothing"
    planner = ViewPlanner(model, CELL, TASK)
    found = planner.plan(initial_estimate(model), TOOL, inside[0].joint_position)
    assert found.move and "way leads through" in found.reason
    assert reach.is_clear(reach.camera_capsules(found.joint_position), coming)
