"""Needle threading: the thread's shape, the needle's geometry, and the rules."""

from __future__ import annotations

import math

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks.needle_threading.task import NEEDLE, NeedleThreading
from samrl_core.cell.tasks.needle_threading.thread import crossing_distance, length_below, point_at
from samrl_core.cell.tasks.needle_threading.tool import capsule_inertia
from samrl_core.cell.tasks.task import Ending
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError

TASK = NeedleThreading()
STRAIGHT = np.zeros(20)
LENGTH = 0.1


def gripped(end_above_eye: float, x: float = 0.0) -> np.ndarray:
    """The tip from which a straight thread ends so far above the eye's centre, beside its axis by x."""
    return TASK.eye + [x, 0.0, LENGTH + end_above_eye]


def ended(points: np.ndarray) -> Ending:
    """The episode ended with the thread there."""
    return Ending(
        {NEEDLE: Pose(TASK.eye, Pose.identity().quat_xyzw)}, {NEEDLE: 0.0}, {NEEDLE: 0.0}, points[0], points
    )


def test_thread_hangs_from_the_tip() -> None:
    """Straight down; one angle about x or y turns all below it."""
    tip = gripped(0.05)
    points = TASK.thread_points(STRAIGHT, tip)
    np.testing.assert_allclose(points, [tip - [0, 0, 0.01 * k] for k in range(11)], atol=1e-12)
    bent = STRAIGHT.copy()
    bent[1] = 0.2  # y of the first link
    end = TASK.thread_points(bent, tip)[-1] - tip
    np.testing.assert_allclose(end, LENGTH * np.array([math.sin(0.2), 0.0, -math.cos(0.2)]), atol=1e-12)
    bent = STRAIGHT.copy()
    bent[8] = 0.2  # x of the fifth
    end = TASK.thread_points(bent, tip)[-1] - tip
    expected = np.array([0.0, 0.06 * math.sin(0.2), -0.04 - 0.06 * math.cos(0.2)])
    np.testing.assert_allclose(end, expected, atol=1e-12)


def test_values_and_points_go_round() -> None:
    """Angles are found again from the points, far beyond what is drawn."""
    values = np.random.default_rng(0).uniform(-0.7, 0.7, 20)
    np.testing.assert_allclose(TASK.values_of(TASK.thread_points(values, gripped(0.05))), values, atol=1e-9)


def test_capsules_weigh_what_solids_do() -> None:
    """Moments by counting points within the shape."""
    radius, length, mass = 0.002, 0.010, 0.0005
    half = np.array([radius, radius, 0.5 * length + radius])
    points = np.random.default_rng(0).uniform(-half, half, (400_000, 3))
    away = np.maximum(np.abs(points[:, 2]) - 0.5 * length, 0.0)
    inside = points[np.hypot(np.hypot(points[:, 0], points[:, 1]), away) < radius]
    x2, y2, z2 = (inside**2).mean(axis=0)
    expected = mass * np.array([y2 + z2, x2 + z2, x2 + y2])
    np.testing.assert_allclose(np.diag(capsule_inertia(radius, length, mass)), expected, rtol=0.01)


def test_scene_is_as_declared() -> None:
    """Ten links of 0.5 g on the bare hand; the needle stands on the table and leaves its eye free."""
    scene = TASK.scene(cell_named())
    assert len(scene.tool.chain) == 10
    assert sum(link.mass for link in scene.tool.chain) == pytest.approx(0.005)
    assert scene.tool.mass == pytest.approx(0.73)
    np.testing.assert_allclose(scene.tool.tip_in_flange.position, [0, 0, 0.1034])
    (needle,) = scene.bodies
    np.testing.assert_allclose(needle.body_in_world.position, [0.5, 0.0, 0.12])
    vertices = needle.body_in_world.apply(needle.mesh.vertices)
    assert vertices[:, 2].min() == pytest.approx(0.0, abs=1e-12)
    assert vertices[:, 2].max() == pytest.approx(0.122)
    ring = needle.mesh.vertices[needle.mesh.vertices[:, 2] > -0.0021]
    assert np.hypot(ring[:, 0], ring[:, 1]).min() >= TASK.eye_radius
    a, b, c = (needle.mesh.vertices[needle.mesh.faces[:, i]] for i in range(3))
    ring_volume = 0.004 * 16 * np.tan(np.pi / 16) * (0.012**2 - 0.007**2)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 == pytest.approx(ring_volume + 0.006**2 * 0.122)


def test_draws_are_uniform_in_ten_degrees() -> None:
    """20 angles; no body is moved."""
    rng = np.random.default_rng(0)
    draws = [TASK.sample_start(rng) for _ in range(200)]
    assert all(d.body_in_world == {} for d in draws)
    angles = np.array([d.chain_angles for d in draws])
    assert angles.shape == (200, 20)
    assert np.abs(angles).max() <= math.radians(10.0)
    np.testing.assert_allclose(np.abs(angles).max(axis=0), math.radians(10.0), rtol=0.1)
    # Ends lie as far off as a sum of so many turns says: with 10 links of 10 mm some 15 mm.
    ends = np.array([TASK.thread_points(a, np.zeros(3))[-1, :2] for a in angles])
    assert 0.010 < ends.std() < 0.022


def test_lengths_along_a_bent_thread() -> None:
    """One horizontal metre, one down: points, lengths and crossings."""
    points = np.array([[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [1.0, 0.0, 1.0]])
    assert length_below(points, 0.5) == 0.0
    assert length_below(points, 1.25) == pytest.approx(0.25)
    np.testing.assert_allclose(point_at(points, 0.25), [1.0, 0.0, 1.25])
    np.testing.assert_allclose(point_at(points, 1.25), [0.75, 0.0, 2.0])
    np.testing.assert_allclose(point_at(points, 5.0), points[0])
    assert crossing_distance(points, np.array([0.5, 0.0, 1.5])) == pytest.approx(0.5)
    assert crossing_distance(points, np.array([0.0, 0.0, 0.5])) == pytest.approx(1.0)  # above: its end


@pytest.mark.parametrize(
    ("tip", "first"),
    [
        (gripped(0.05, 0.02), "above"),
        (gripped(0.012, 0.004), "above"),
        (gripped(0.012, 0.001), "thread_1"),
        (gripped(0.005, 0.003), "thread_1"),
        (gripped(0.005, 0.006), "above"),
        (gripped(-0.004, 0.003), "thread_2"),
        (gripped(-0.004, 0.015), "clear"),
    ],
)
def test_first_sub_goal(tip: np.ndarray, first: str) -> None:
    """By where the thread's end is."""
    assert TASK.sub_goals(STRAIGHT, tip)[0].name == first


def test_sub_goals_lead_a_crooked_thread_through() -> None:
    """At each of them, were the thread stiff, the eye's plane is crossed near the axis; the last is deep."""
    values = TASK.sample_start(np.random.default_rng(4)).chain_angles
    goals = TASK.sub_goals(values, gripped(0.05))
    assert goals[0].name == "above"
    end = TASK.thread_points(values, goals[0].tip_position)[-1]
    np.testing.assert_allclose(end, TASK.eye + [0, 0, TASK.hover], atol=1e-12)
    for goal in goals[1:]:
        points = TASK.thread_points(values, goal.tip_position)
        assert crossing_distance(points, TASK.eye) < 1e-9
    assert TASK.is_done(values, goals[-1].tip_position)
    assert TASK.sub_goals(values, goals[-1].tip_position) == ()


@pytest.mark.parametrize(
    ("above", "x", "done", "success"),
    [
        (-0.0225, 0.0, True, True),
        (-0.021, 0.0, False, True),
        (-0.019, 0.0, False, False),
        (-0.025, 0.0065, True, True),
        (-0.025, 0.0075, False, False),
        (0.05, 0.0, False, False),
    ],
)
def test_done_and_succeeded(above: float, x: float, done: bool, success: bool) -> None:
    """Depth and place of both judgements."""
    tip = gripped(above, x)
    assert TASK.is_done(STRAIGHT, tip) is done
    assert TASK.succeeded(ended(TASK.thread_points(STRAIGHT, tip))) is success


def test_final_error() -> None:
    """What is missing in depth, and the way to the axis."""
    assert TASK.final_error(ended(TASK.thread_points(STRAIGHT, gripped(0.01)))) == pytest.approx(0.03)
    aside = TASK.thread_points(STRAIGHT, gripped(-0.03, 0.004))
    assert TASK.final_error(ended(aside)) == pytest.approx(0.004)


def test_bad_input_is_refused() -> None:
    """Estimates, tips and settings."""
    with pytest.raises(InputError, match="20 joint angles"):
        TASK.chain_angles(np.zeros(19))
    with pytest.raises(InputError, match="20 joint angles"):
        TASK.body_poses(np.full(20, np.nan))
    with pytest.raises(InputError, match="tip"):
        TASK.is_done(STRAIGHT, np.full(3, np.nan))
    with pytest.raises(InputError, match="must be larger"):
        NeedleThreading(eye_radius=0.002)
    with pytest.raises(InputError, match="too short"):
        NeedleThreading(links=2)
    with pytest.raises(InputError, match="stiffness"):
        NeedleThreading(stiffness=0.0)
    with pytest.raises(InputError, match="needs 20 finite angles"):
        from samrl_core.cell.tasks.chain import link_poses

        link_poses(TASK.scene(cell_named()).tool.chain, Pose.identity(), np.zeros(3))
