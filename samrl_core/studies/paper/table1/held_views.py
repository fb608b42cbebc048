"""Views that are held for a whole episode: which there are, and which of them is best."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.robots.geometry import Capsules
from samrl_core.cell.robots.inverse_kinematics import solve_ik
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.start import DOWN
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.pose import Pose
from samrl_core.model.real2sim.emd import farthest_points
from samrl_core.policy.view.view_reach import View, ViewReach
from samrl_core.studies.experiment import Case


@dataclass(frozen=True, eq=False)
class HeldView:
    """A camera pose, and how the camera arm gets there from where the task starts."""

    camera_in_world: Pose
    way: tuple[np.ndarray, ...]  # joint positions (J,) one after the other, the last one takes the view [rad]


def held_views(task: Task, cell: CellSpec) -> tuple[HeldView, ...]:
    """Reachable views that stay clear of the tool arm, all along the task in its nominal state.

    The camera arm gets there by way of others, straight in joint space from each to the next, and clear.
    """
    reach = ViewReach(cell, task)
    start = task.start_joints(cell)
    nominal = np.array([p.nominal for p in task.parameters()])
    at_start = reach.obstacles(start["tool_arm"], nominal)
    ahead = [reach.tool_capsules(q, nominal) for q in _tool_way(task, cell, start["tool_arm"], nominal)]
    left = reach.clear_views(at_start)
    ways: list[tuple[View, tuple[np.ndarray, ...]]] = []
    tips: list[tuple[np.ndarray, ...]] = [(start["camera_arm"],)]
    while tips:  # breadth first: as few stops as can be
        way = tips.pop(0)
        near = [v for v in left if reach.way_is_clear(way[-1], v.joint_position, at_start)]
        left = [v for v in left if v not in near]
        ways += [(v, (*way[1:], v.joint_position)) for v in near]
        tips += [(*way, v.joint_position) for v in near]
    whole = Capsules.joined((at_start, *ahead))
    return tuple(HeldView(v.camera_in_world, way) for v, way in ways if reach.is_clear(v.capsules, whole))


def spread_views(views: Sequence[HeldView], count: int) -> list[int]:
    """Numbers of at most `count` views whose cameras stand well apart, in rising order."""
    positions = np.array([view.camera_in_world.position for view in views])
    return sorted(int(i) for i in farthest_points(positions, min(count, len(views))))


def ranked_views(cases: Sequence[Case]) -> list[int]:
    """Numbers of the views (`view` of each case), the best first: most successes, then fewest actions.

    Only views of as many cases as the most tried one are ranked.
    """
    of_view: dict[int, list[Case]] = defaultdict(list)
    for case in cases:
        of_view[case["view"]].append(case)
    most = max(len(some) for some in of_view.values())

    def worth(view: int) -> tuple[int, float, int]:
        some = of_view[view]
        return -sum(c["success"] for c in some), float(np.mean([c["actions"] for c in some])), view

    return sorted((view for view, some in of_view.items() if len(some) == most), key=worth)


def _tool_way(task: Task, cell: CellSpec, start: np.ndarray, values: np.ndarray) -> list[np.ndarray]:
    """Tool arm positions (J,) [rad] at the sub-goals."""
    tool = task.scene(cell).tool
    arm = ArmModel(cell.tool_arm, cell.tool_base_in_world, None)
    tip = (arm.flange_in_base(start) @ tool.tip_in_flange).position
    found: list[np.ndarray] = []
    for goal in task.sub_goals(values, tip):
        flange = Pose.from_rotation(goal.tip_position, DOWN) @ tool.tip_in_flange.inverse()
        start = solve_ik(arm, flange, start)
        found.append(start)
    return found
