"""The view planner: reach, clearance, the score's sense, strategies, refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.robots.geometry import Capsules
from samrl_core.cell.tasks.task import ViewRegion
from samrl_core.cell.types.camera import Camera
from samrl_core.cell.types.pose import look_at
from samrl_core.common.errors import InputError
from samrl_core.model.model import Model
from samrl_core.model.real2sim.real2sim import Estimate, initial_estimate
from samrl_core.model.real2sim.target_renderer import TargetRenderer
from samrl_core.policy.view.view_planning import ViewPlanner
from samrl_core.policy.view.view_reach import ReachSettings, ViewReach, grid


@pytest.fixture(scope="module")
def start(model: Model) -> dict[str, np.ndarray]:
    """Joint positions at the start of an episode."""
    return model.task.start_joints(model.cell)


@pytest.fixture(scope="module")
def estimate(model: Model) -> Estimate:
    """Known to half a millimetre, as after a first image."""
    return replace(initial_estimate(model), covariance=np.eye(2) * (5e-4) ** 2)


@pytest.fixture(scope="module")
def reach(model: Model) -> ViewReach:
    """A coarse grid of its own."""
    return ViewReach(model.cell, model.task, ReachSettings(azimuths=6, elevations=2, distances=1))


def test_views_are_reached_within_limits_and_look_at_the_target(model: Model, reach: ViewReach) -> None:
    """Joint margins hold, the optical axis meets the region's target, and the pose is that of the joints."""
    region, limits = model.task.view_region(), model.cell.camera_arm.limits
    assert len(reach.views) >= 4
    for view in reach.views:
        margin = reach.settings.limit_margin - 1e-9
        assert (view.joint_position >= limits.lower + margin).all()
        assert (view.joint_position <= limits.upper - margin).all()
        ahead = view.camera_in_world.inverse().apply(region.target)
        assert np.hypot(ahead[0], ahead[1]) < 1e-3
        assert region.distance[0] - 1e-3 < ahead[2] < region.distance[1] + 1e-3


def test_views_keep_their_distance(reach: ViewReach) -> None:
    """Clearance is asked for: from the board, and from a pillar put where a view is."""
    nominal = reach.body_capsules(np.array([0.5, 0.0]))
    view = reach.views[0]
    assert reach.is_clear(view.capsules, nominal)
    place = view.camera_in_world.position
    pillar = Capsules(place[None], place[None] + [0, 0, 0.3], np.array([0.02]))
    assert not reach.is_clear(view.capsules, pillar)
    other = reach.views[-1]
    assert not reach.way_is_clear(other.joint_position, view.joint_position, pillar)


def test_a_full_circle_has_no_view_twice() -> None:
    """The last azimuth of a full circle is not the first."""
    region = ViewRegion(np.zeros(3), (0.3, 0.3), (-np.pi, np.pi), (0.5, 0.5))
    places = grid(region, ReachSettings(azimuths=8, elevations=1, distances=1, rolls=(0.0,)))
    eyes = np.array([p[0].position for p in places])
    gaps = np.linalg.norm(eyes[:, None] - eyes[None], axis=-1) + np.eye(len(eyes))
    assert len(eyes) == 8 and gaps.min() > 0.1


def test_best_view_is_better_clear_and_sees_the_target(
    planner: ViewPlanner, estimate: Estimate, start: dict[str, np.ndarray]
) -> None:
    """From the start view there is a better one; from that one, none that pays."""
    choice = planner.plan(estimate, start["tool_arm"], start["camera_arm"])
    assert choice.move and choice.score > choice.present_score
    assert choice.visibility > 0.5 and choice.candidates > 5
    settled = replace(estimate, covariance=np.eye(2) * (1e-4) ** 2)
    again = planner.plan(settled, start["tool_arm"], choice.joint_position)
    assert not again.move and "stays" in again.reason
    np.testing.assert_allclose(again.joint_position, choice.joint_position)
    repeated = planner.plan(estimate, start["tool_arm"], start["camera_arm"])
    np.testing.assert_array_equal(repeated.joint_position, choice.joint_position)
    assert repeated.score == choice.score


def test_fixed_stays_and_random_follows_its_generator(
    planner: ViewPlanner, estimate: Estimate, start: dict[str, np.ndarray]
) -> None:
    """The two strategies of comparison."""
    arms = (start["tool_arm"], start["camera_arm"])
    assert not planner.plan(estimate, *arms, "fixed").move
    draws = [planner.plan(estimate, *arms, "random", np.random.default_rng(s)) for s in (1, 1, 2)]
    np.testing.assert_array_equal(draws[0].joint_position, draws[1].joint_position)
    assert all(d.move for d in draws)


def test_visibility_falls_behind_the_tool_and_outside_the_image(
    model: Model, estimate: Estimate, start: dict[str, np.ndarray]
) -> None:
    """Nearly all from the side; little through the hand; nothing when looking away."""
    target = np.array([0.5, 0.0, 0.04])

    def seen(eye: list[float], look: np.ndarray) -> float:
        camera = Camera(model.cell.intrinsics, look_at(np.array(eye), look))
        renderer = TargetRenderer(model, camera, start["tool_arm"])
        return renderer.visibility(estimate.values, estimate.colors)

    side = seen([0.75, 0.15, 0.25], target)
    assert side > 0.8
    assert seen([0.505, 0.0, 0.5], target) < 0.6 * side
    assert seen([0.75, 0.15, 0.25], np.array([1.5, 0.6, 0.2])) == 0.0


def test_refuses_unknown_strategy_and_missing_generator(
    planner: ViewPlanner, estimate: Estimate, start: dict[str, np.ndarray]
) -> None:
    """With the names that exist, and what to hand in."""
    with pytest.raises(InputError, match="best, fixed, random"):
        planner.plan(estimate, start["tool_arm"], start["camera_arm"], "luckiest")
    with pytest.raises(InputError, match="generator"):
        planner.plan(estimate, start["tool_arm"], start["camera_arm"], "random")
    with pytest.raises(InputError):
        planner.plan(estimate, np.full(7, np.nan), start["camera_arm"])
