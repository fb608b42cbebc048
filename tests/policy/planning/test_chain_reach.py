"""A chain that hangs from the tool is an obstacle, and views are ranked by what they tell of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.robots.geometry import Capsules
from samrl_core.cell.tasks import task_named
from samrl_core.cell.tasks.needle_threading.task import NeedleThreading
from samrl_core.model.model import Model
from samrl_core.model.real2sim.real2sim import initial_estimate
from samrl_core.policy.view.view_planning import ViewPlanner, ViewPlanningSettings
from samrl_core.policy.view.view_reach import ReachSettings, ViewReach

REACH = ReachSettings(azimuths=3, elevations=1, distances=1)


@pytest.fixture(scope="module")
def thread() -> tuple[NeedleThreading, ViewReach, np.ndarray]:
    """The task, its reach and the tool arm's start."""
    task, cell = NeedleThreading(), cell_named()
    return task, ViewReach(cell, task, REACH), task.start_joints(cell)["tool_arm"]


def test_capsules_of_the_thread_lie_where_it_hangs(thread) -> None:
    """Ten of them, end to end along the thread's points, and they move with the angles."""
    task, reach, joints = thread
    straight, bent = np.zeros(20), np.full(20, 0.15)
    for values in (straight, bent):
        capsules = reach.tool_capsules(joints, values)
        links = slice(-10, None)
        points = task.thread_points(values, _tip(reach, joints))
        np.testing.assert_allclose(capsules.start[links], points[:-1], atol=1e-4)
        np.testing.assert_allclose(capsules.end[links], points[1:], atol=1e-4)
        np.testing.assert_allclose(capsules.radius[links], task.thread_radius)
    assert np.linalg.norm(points[-1] - task.thread_points(straight, _tip(reach, joints))[-1]) > 0.05


def test_a_thing_beside_the_thread_is_too_near_only_when_it_hangs_there(thread) -> None:
    """A pin where the bent thread ends; the straight one is clear of it."""
    task, reach, joints = thread
    bent = np.full(20, 0.15)
    end = task.thread_points(bent, _tip(reach, joints))[-1]
    pin = Capsules(end[None], end[None] + [0.0, 0.0, -0.01], np.array([0.002]))
    assert not reach.is_clear(pin, reach.tool_capsules(joints, bent))
    assert reach.is_clear(pin, reach.tool_capsules(joints, np.zeros(20)))


def test_views_of_thread_and_pancake_are_scored(thread) -> None:
    """Finite, and no view tells less than nothing."""
    for name in ("needle_threading", "spatula_flipping"):
        task, cell = task_named(name), cell_named()
        model = Model(task, cell)
        planner = ViewPlanner(model, cell, task, ViewPlanningSettings(reach=REACH, finalists=1))
        start = task.start_joints(cell)
        estimate = initial_estimate(model)
        choice = planner.plan(estimate, start["tool_arm"], start["camera_arm"])
        scale = np.array([p.scale for p in task.parameters()])
        known = -np.linalg.slogdet(estimate.covariance / np.outer(scale, scale))[1]
        assert np.isfinite(choice.score) and choice.present_score > known + 1.0
        assert 0.0 < choice.visibility <= 1.0
        sure = replace(estimate, covariance=estimate.covariance * 1e-6)
        assert not planner.plan(sure, start["tool_arm"], start["camera_arm"]).move


def _tip(reach: ViewReach, joints: np.ndarray) -> np.ndarray:
    flange = reach._tool_arm.link_poses_in_world(joints)[reach._cell.tool_arm.flange]
    return (flange @ reach._tool.tip_in_flange).position
