"""Ascent of Q by the view: the gradient, line 10's test, what the arm can reach, what moving costs."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from torch import nn
from torch.nn import functional

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.pose import Pose, look_at
from samrl_core.common.errors import InputError
from samrl_core.model.model import Model, world_to_camera
from samrl_core.model.real2sim.real2sim import initial_estimate
from samrl_core.model.scene.settings import ModelSettings
from samrl_core.policy.networks.network_image import network_image, upright
from samrl_core.policy.networks.networks import SensingQ, SimActor
from samrl_core.policy.view.sensing_value import Networks, SensingValue
from samrl_core.policy.view.view_ascent import ViewAscent, ViewAscentSettings, camera_poses
from samrl_core.policy.view.view_reach import (
    ReachSettings,
    ViewReach,
    bounds_of,
    viewpoint_of,
    viewpoint_position,
)
from samrl_core.policy.view.view_search import Answer, Request, SearchResult, ViewSearch

COARSE = ReachSettings(azimuths=6, elevations=2, distances=1)
SETTINGS = ViewAscentSettings(reach=COARSE, initial_views=5, starts=2, steps=3)
CHANNELS = {"colour": [0, 1, 2], "points": [3, 4, 5], "all": [0, 1, 2, 3, 4, 5]}


class SmoothQ(nn.Module):
    """A Q that varies with the view over many degrees: random weights on the blurred image."""

    weights: torch.Tensor

    def __init__(self, channels: str = "all", gain: float = 1.0) -> None:
        super().__init__()
        self._channels, self._gain = CHANNELS[channels], gain
        drawn = torch.randn((len(self._channels), 4, 4), generator=torch.Generator().manual_seed(1))
        self.register_buffer("weights", drawn)

    def forward(self, image: torch.Tensor, action: torch.Tensor) -> torch.Tensor:
        blurred = functional.avg_pool2d(image[:, self._channels], 32)
        total = self._gain * (blurred * self.weights).sum(dim=(1, 2, 3)) + 20.0 * action.sum(dim=1)
        return torch.sigmoid(0.1 * total)


def networks(q: Any) -> Networks:
    actor = SimActor(0.01, torch.Generator().manual_seed(2)).requires_grad_(False).eval()
    return Networks(actor, q)


@pytest.fixture(scope="module")
def joints(model: Model) -> dict[str, np.ndarray]:
    return model.task.start_joints(model.cell)


@pytest.fixture(scope="module")
def ascent(model: Model) -> ViewAscent:
    found = ViewAscent(model, model.cell, model.task, networks(SmoothQ()), SETTINGS)
    found.prepare()
    return found


def with_settings(ascent: ViewAscent, q: Any, **changes: Any) -> ViewAscent:
    """The same, its grid not solved again."""
    found = ViewAscent(
        ascent._model, ascent._cell, ascent._model.task, networks(q), replace(SETTINGS, **changes)
    )
    found._reach = ascent._reach
    return found


def test_what_a_plan_asks_of_the_networks_is_compiled_before(
    ascent: ViewAscent, joints: dict[str, np.ndarray]
) -> None:
    """torch keeps what it compiles for each number of images, with and without gradient."""
    asked: list[tuple[int, bool]] = []

    class Counting(SmoothQ):
        def forward(self, image: torch.Tensor, action: torch.Tensor) -> torch.Tensor:
            asked.append((len(image), image.requires_grad))
            return super().forward(image, action)

    counting = with_settings(ascent, Counting(), initial_views=2, starts=3)
    counting.prepare()
    prepared = set(asked)
    asked.clear()
    counting.plan(initial_estimate(ascent._model), joints["tool_arm"], joints["camera_arm"])
    assert len(asked) > 3 and set(asked) <= prepared


def test_a_viewpoint_is_the_pose_that_looks_at_the_target(model: Model) -> None:
    """One convention for images, grid and arm, there and back."""
    region = model.task.view_region()
    viewpoints = np.array([[0.7, 0.6, 0.38], [-2.0, 0.9, 0.31]])
    rotation, translation = camera_poses(torch.from_numpy(viewpoints), region.target)
    for k, viewpoint in enumerate(viewpoints):
        position = viewpoint_position(viewpoint, region)
        wanted = world_to_camera(look_at(position, region.target))
        np.testing.assert_allclose(rotation[k], wanted[0], atol=1e-12)
        np.testing.assert_allclose(translation[k], wanted[1], atol=1e-12)
        np.testing.assert_allclose(viewpoint_of(position, region), viewpoint, atol=1e-12)
    lower, upper = bounds_of(region)
    np.testing.assert_allclose(viewpoint_of(region.target + [0.0, 0.0, 2.0], region)[1:], upper[1:])
    assert (viewpoint_of(region.target + [0.1, 0.0, 0.0], region) >= lower).all()


@pytest.mark.parametrize("channels", list(CHANNELS))
@pytest.mark.parametrize("through_action", [False, True])
def test_gradient_of_q_by_the_view(model: Model, channels: str, through_action: bool) -> None:
    """Eq. 17: the gradients along a line add up to the difference of its ends.

    Of its ends only: pixels change sides one by one in between, and their points with them.
    """
    assert_gradients_add_up(model, SmoothQ(channels), np.array([0.9, 0.75, 0.36]), through_action)


@pytest.mark.parametrize(
    ("task", "viewpoint"),
    [
        ("peg_insertion_occluded", (0.71, 0.47, 0.30)),
        ("needle_threading_occluded", (0.71, 0.47, 0.30)),
        ("spatula_flipping_occluded", (-0.71, 0.59, 0.45)),
    ],
)
def test_gradient_where_screens_and_the_tables_end_are_in_sight(
    task: str, viewpoint: tuple[float, float, float]
) -> None:
    """Beside nothing XYZ jumps to 0, behind a screen to what is clipped: such borders move, too."""
    screened = Model(task_named(task), cell_named(), ModelSettings(threads=1))
    assert_gradients_add_up(screened, SmoothQ("points"), np.array(viewpoint), False)


def assert_gradients_add_up(model: Model, q: nn.Module, viewpoint: np.ndarray, through_action: bool) -> None:
    """Along a line in each coordinate, within a tenth."""
    trained = networks(q)
    joints = model.task.start_joints(model.cell)["tool_arm"]
    value = SensingValue(model, trained, initial_estimate(model), joints)
    target, scale = model.task.view_region().target, np.array([1.0, 1.0, 0.4])
    way = np.linspace(-0.05, 0.05, 15)
    gradients, ends = np.zeros(3), np.zeros(3)
    for k in range(3):
        viewpoints = np.tile(viewpoint, (len(way), 1))
        viewpoints[:, k] += way * scale[k]
        variable = torch.from_numpy(viewpoints).requires_grad_(True)
        image = value.image(camera_poses(variable, target))
        held = trained.actor(image.detach()[len(way) // 2 :][:1]).expand(len(way), 3)
        found = value.q(image, True)[0] if through_action else trained.q(image, held)
        gradient = torch.autograd.grad(found.sum(), variable)[0][:, k].numpy() * scale[k]
        gradients[k] = np.trapezoid(gradient, way)
        ends[k] = float((found[-1] - found[0]).detach())
    assert np.linalg.norm(ends) > 1e-4  # there is something to find
    assert np.linalg.norm(gradients - ends) < 0.1 * np.linalg.norm(ends), (gradients, ends)


def test_a_camera_turned_over_gives_the_same_image(model: Model, joints: dict[str, np.ndarray]) -> None:
    """Half of the reachable views are such."""
    region = model.task.view_region()
    eye = viewpoint_position(np.array([0.7, 0.6, 0.38]), region)
    value = SensingValue(model, networks(SmoothQ()), initial_estimate(model), joints["tool_arm"])
    up = value.view(look_at(eye, region.target))
    over = value.view(look_at(eye, region.target, np.pi))
    assert not torch.equal(up, up.flip((-2, -1)))
    assert float((up - over).abs().mean()) < 1e-3  # but for samples that fall on the other side of an edge


def test_moves_uphill_to_where_the_arm_can_be(
    ascent: ViewAscent, model: Model, joints: dict[str, np.ndarray]
) -> None:
    """Q rises by more than the price, and the place is reached, clear, and within the region."""
    estimate = initial_estimate(model)
    eager = with_settings(ascent, SmoothQ(), min_gain=0.0, time_penalty=1e-4)
    choice = eager.plan(estimate, joints["tool_arm"], joints["camera_arm"])
    assert choice.move and choice.score > choice.present_score
    limits, reach = model.cell.camera_arm.limits, ViewReach(model.cell, model.task, COARSE)
    margin = COARSE.limit_margin - 1e-9
    assert (choice.joint_position >= limits.lower + margin).all()
    assert (choice.joint_position <= limits.upper - margin).all()
    obstacles = reach.tool_capsules(joints["tool_arm"], estimate.values)
    assert reach.is_clear(reach.camera_capsules(choice.joint_position), obstacles)
    assert reach.way_is_clear(joints["camera_arm"], choice.joint_position, obstacles)
    ahead = choice.camera_in_world.inverse().apply(model.task.view_region().target)
    assert np.hypot(ahead[0], ahead[1]) < 1e-3
    low, high = model.task.view_region().distance
    assert low - 1e-3 < ahead[2] < high + 1e-3
    largest_gain = 1 + SETTINGS.initial_views + SETTINGS.starts * (1 + SETTINGS.steps)
    assert SETTINGS.initial_views < choice.candidates <= largest_gain
    # Its Q is that of the image from there.
    value = SensingValue(model, networks(SmoothQ()), estimate, joints["tool_arm"])
    again = float(value.q(value.view(choice.camera_in_world))[0])
    assert again == pytest.approx(choice.score, abs=5e-3)


def test_climbing_beats_the_grid_and_never_goes_down(
    ascent: ViewAscent, model: Model, joints: dict[str, np.ndarray]
) -> None:
    """Line 10: no accepted step is worse than what it came from; with steps, better than the starts."""
    estimate = initial_estimate(model)
    ends = {}
    for steps in (0, 3):
        free = with_settings(ascent, SmoothQ(gain=3.0), min_gain=-1.0, time_penalty=0.0, steps=steps)
        ends[steps] = free.plan(estimate, joints["tool_arm"], joints["camera_arm"]).score
    assert ends[3] > ends[0] + 1e-3


def test_stays_where_moving_costs_more_than_it_gains(
    ascent: ViewAscent, model: Model, joints: dict[str, np.ndarray]
) -> None:
    """The price of motion, the least gain, and a Q that does not care."""
    estimate = initial_estimate(model)
    for q, changes in ((SmoothQ(), {"time_penalty": 10.0}), (SmoothQ(gain=0.0), {})):
        reluctant = with_settings(ascent, q, **changes)
        choice = reluctant.plan(estimate, joints["tool_arm"], joints["camera_arm"])
        assert not choice.move and choice.reason.startswith("stays")
        np.testing.assert_array_equal(choice.joint_position, joints["camera_arm"])
        assert choice.score == choice.present_score


def test_networks_that_say_nothing_finite_are_refused(
    ascent: ViewAscent, model: Model, joints: dict[str, np.ndarray]
) -> None:
    broken = with_settings(ascent, SmoothQ(gain=float("nan")))
    with pytest.raises(InputError, match="train them anew"):
        broken.plan(initial_estimate(model), joints["tool_arm"], joints["camera_arm"])


def test_untrained_networks_can_be_climbed(
    ascent: ViewAscent, model: Model, joints: dict[str, np.ndarray]
) -> None:
    """The real Q, and the same answer twice."""
    q = SensingQ(torch.Generator().manual_seed(3)).requires_grad_(False).eval()
    twice = [
        with_settings(ascent, q).plan(initial_estimate(model), joints["tool_arm"], joints["camera_arm"])
        for _ in range(2)
    ]
    assert twice[0].score == twice[1].score and twice[0].reason == twice[1].reason
    assert 0.0 < twice[0].score < 1.0 and 0.0 < twice[0].visibility <= 1.0


def test_network_image_of_one_pixel_turned() -> None:
    """`upright` turns by half: it mirrors nothing."""
    color = torch.zeros((4, 4, 3))
    color[0, 1] = 1.0
    tip, base = torch.zeros(3), Pose.identity()
    image = network_image(color, torch.ones((4, 4, 3)), torch.ones((4, 4)), tip, base)
    over = upright(image, look_at(np.array([0.3, 0.0, 0.3]), np.zeros(3), np.pi).rotation)
    assert float(over[0, 3, 2]) == float(image[0, 0, 1]) != float(image[0, 0, 0])


@pytest.mark.thorough
def test_goes_to_where_the_target_can_be_seen() -> None:
    """Behind a screen the present view is worth nothing, whatever Q says."""
    hidden = Model(task_named("needle_threading_occluded"), cell_named())
    estimate, joints = initial_estimate(hidden), hidden.task.start_joints(hidden.cell)
    found = {}
    for least in (0.0, 0.5):
        settings = ViewAscentSettings(initial_views=40, starts=1, steps=1, least_visibility=least)
        behind = ViewAscent(hidden, hidden.cell, hidden.task, networks(SmoothQ(gain=0.0)), settings)
        found[least] = behind.plan(estimate, joints["tool_arm"], joints["camera_arm"])
    assert not found[0.0].move and found[0.0].visibility < 0.1
    assert found[0.5].move and found[0.5].visibility >= 0.5
    assert found[0.5].score == pytest.approx(found[0.5].present_score, abs=0.05)


def search_of(ascent: ViewAscent, joints: dict[str, np.ndarray], least_visibility: float) -> ViewSearch:
    """At the start, of first looks alone, whose Q and whose visibility the test makes up."""
    task = ascent._model.task
    nominal = initial_estimate(ascent._model).values
    settings = replace(SETTINGS, min_gain=0.0, time_penalty=0.0, starts=0, least_visibility=least_visibility)
    obstacles = ascent._reach.obstacles(joints["tool_arm"], nominal)
    here = joints["camera_arm"]
    return ViewSearch(ascent._cell, task.view_region(), ascent._reach, settings, here, obstacles)


def end_of(asking: Generator[Request, Answer, SearchResult], q: np.ndarray | float) -> SearchResult:
    """What a search of one request finds, Q of the looks being `q`."""
    viewpoints = next(asking).viewpoints
    with pytest.raises(StopIteration) as end:
        asking.send(Answer(np.broadcast_to(q, len(viewpoints)), np.zeros(viewpoints.shape)))
    return end.value.value


@pytest.mark.parametrize(("present_shows", "moves"), [(0.25, False), (0.15, True)])
def test_q_decides_among_the_views_that_show_enough(
    ascent: ViewAscent,
    joints: dict[str, np.ndarray],
    monkeypatch: pytest.MonkeyPatch,
    present_shows: float,
    moves: bool,
) -> None:
    """Not how much they show beyond that; the present one is worth nothing if it shows less."""
    monkeypatch.setattr(ascent._reach, "way_is_clear", lambda *way: True)
    shown = {0.9: 0.1, 0.7: 0.3, 0.5: 1.0}  # by Q
    asking = search_of(ascent, joints, 0.2).run(0.8, present_shows, lambda scored: shown[scored.q])
    found = end_of(asking, np.array(list(shown)))
    assert [scored.q for scored in found.moves] == ([0.7] if moves else [])


def test_no_view_is_taken_that_hides_the_target(
    ascent: ViewAscent, model: Model, joints: dict[str, np.ndarray]
) -> None:
    """Where none shows enough, none is gone to that shows less than the present one."""
    asks = initial_estimate(model), joints["tool_arm"], joints["camera_arm"]
    present = with_settings(ascent, SmoothQ(), min_gain=1.0).plan(*asks).visibility
    assert 0.5 < present < 1.0
    search = search_of(ascent, joints, 1.01)
    for shown, moves in ((present, True), (present - 1e-6, False)):
        found = end_of(search.run(0.1, present, lambda scored, shown=shown: shown), 0.6)
        assert bool(found.moves) == moves
