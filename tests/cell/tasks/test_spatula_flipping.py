"""Spatula flipping: geometry of its bodies, and its rules."""

from __future__ import annotations

import math

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.tasks.shapes import DISC_SIDES as SIDES
from samrl_core.cell.tasks.shapes import disc_mesh
from samrl_core.cell.tasks.spatula_flipping.pancake import BAKED_COLOR, PAINT, RAW_COLOR
from samrl_core.cell.tasks.spatula_flipping.task import LIP, PANCAKE, SpatulaFlipping
from samrl_core.cell.tasks.task import Ending
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Box
from samrl_core.common.errors import InputError

TASK = SpatulaFlipping()
FLAT = np.array([0.51, 0.0, 0.006, 0.0, 0.0])
TURNED = np.array([0.60, 0.0, 0.006, 0.0, math.pi])


def edge(x: float, z: float, y: float = 0.0) -> np.ndarray:
    """The blade's leading edge."""
    return np.array([x, y, z])


def ended(values: np.ndarray, peak: float = 0.05, speed: float = 0.0) -> Ending:
    """The episode ended with the pancake there."""
    return Ending(
        TASK.body_poses(values), {PANCAKE: speed}, {PANCAKE: peak}, edge(0.6, 0.05), np.zeros((0, 3))
    )


def test_disc_is_closed_wound_outwards_and_has_two_faces() -> None:
    """Volume by the divergence theorem: a prism less its two bevels; every edge has two faces."""
    radius, thickness, rounding = 0.05, 0.012, 0.004
    mesh = disc_mesh(radius, thickness, rounding, PAINT)
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    inner = radius - rounding
    area = SIDES / 2 * math.sin(2 * math.pi / SIDES)  # of a polygon of unit radius
    frustum = rounding / 3 * (radius**2 + radius * inner + inner**2)
    expected = area * ((thickness - 2 * rounding) * radius**2 + 2 * frustum)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 == pytest.approx(expected, rel=1e-9)
    edges = {(int(f[i]), int(f[(i + 1) % 3])) for f in mesh.faces for i in range(3)}
    assert len(edges) == 3 * len(mesh.faces) and all((j, i) in edges for i, j in edges)
    up = mesh.vertices[mesh.faces][:, :, 2].min(axis=1) > 0.5 * thickness - 1e-9
    assert (mesh.face_color[up] == RAW_COLOR).all()
    down = mesh.vertices[mesh.faces][:, :, 2].max(axis=1) < -0.5 * thickness + 1e-9
    assert (mesh.face_color[down] == BAKED_COLOR).all()


def test_scene_is_as_declared() -> None:
    """Pancake of 80 g, flat before the lip; a tool whose parts weigh what they should."""
    scene = TASK.scene(cell_named())
    pancake, lip = scene.bodies
    assert (pancake.name, lip.name) == (PANCAKE, LIP)
    assert pancake.mass == 0.080 and lip.mass == 0.0
    assert np.diag(pancake.inertia)[2] == pytest.approx(0.5 * 0.08 * 0.05**2)
    assert lip.body_in_world.position[0] - 0.003 == pytest.approx(TASK.lip_x)
    assert scene.tool.mass == pytest.approx(0.73 + 0.05 + 0.05)
    moments = np.linalg.eigvalsh(scene.tool.inertia)
    assert moments[0] > 0 and moments[0] + moments[1] > moments[2]


def test_the_tip_is_the_blades_leading_edge() -> None:
    """Middle of the blade's front face, and the lowest part of it when the hand points down."""
    tool = TASK.scene(cell_named()).tool
    blade = tool.parts[0]
    assert isinstance(blade, Box)
    front = blade.part_in_body.apply(np.array([blade.half_extents[0], 0.0, 0.0]))
    np.testing.assert_allclose(front, tool.tip_in_flange.position, atol=1e-12)
    np.testing.assert_allclose(front, [0.05, 0.0, 0.2034], atol=1e-12)
    rear = blade.part_in_body.apply(np.array([-blade.half_extents[0], 0.0, 0.0]))
    assert math.atan2(front[2] - rear[2], front[0] - rear[0]) == pytest.approx(TASK.blade_tilt)


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (0.3, -0.2), (0.0, 2.0), (-1.5, 1.5), (1e-9, 0.0)])
def test_values_and_poses_go_round(tilt: tuple[float, float]) -> None:
    """Values of a pose are the values it was made of, whatever the spin about the pancake's axis."""
    values = np.array([0.5, 0.02, 0.03, *tilt])
    pose = TASK.body_poses(values)[PANCAKE]
    np.testing.assert_allclose(TASK.values_of(pose), values, atol=1e-9)
    spun = pose @ Pose.from_rpy(np.zeros(3), (0.0, 0.0, 1.1))
    np.testing.assert_allclose(TASK.values_of(spun), values, atol=1e-9)


def test_an_upside_down_pancake_has_values_too() -> None:
    """At half a turn the axis of the turn is open; any that gives the pose will do."""
    pose = TASK.body_poses(TURNED)[PANCAKE]
    again = TASK.body_poses(TASK.values_of(pose))[PANCAKE]
    np.testing.assert_allclose(again.rotation[:, 2], [0.0, 0.0, -1.0], atol=1e-9)


def test_the_look_alike_is_the_other_face_in_the_same_place() -> None:
    values = np.array([0.55, 0.01, 0.03, 0.2, -0.7])
    (other,) = TASK.look_alikes(values)
    here, turned = (TASK.body_poses(v)[PANCAKE] for v in (values, other))
    np.testing.assert_allclose(turned.position, here.position)
    np.testing.assert_allclose(turned.rotation[:, 2], -here.rotation[:, 2], atol=1e-12)
    np.testing.assert_allclose(TASK.look_alikes(other)[0], values, atol=1e-12)


def test_draws_stay_in_the_range_and_fill_it() -> None:
    """2 cm x 2 cm, flat."""
    rng = np.random.default_rng(0)
    places = np.array([TASK.sample_start(rng).body_in_world[PANCAKE].position for _ in range(300)])
    np.testing.assert_allclose(places.min(0), [0.50, -0.01, 0.006], atol=5e-4)
    np.testing.assert_allclose(places.max(0), [0.52, 0.01, 0.006], atol=5e-4)


def test_parameters_hold_the_whole_episode() -> None:
    """From the start to half a turn beyond the lip."""
    lower, upper = (np.array([getattr(p, n) for p in TASK.parameters()]) for n in ("lower", "upper"))
    for values in (FLAT, TURNED, np.array([0.58, 0.0, 0.05, 0.0, math.pi / 2])):
        assert (values >= lower).all() and (values <= upper).all()


@pytest.mark.parametrize(
    ("tip", "first"),
    [
        (edge(0.40, 0.02), "behind"),
        (edge(0.43, 0.0015), "under"),
        (edge(0.50, 0.0015), "under"),
        (edge(0.50, 0.0015, 0.02), "clear"),
        (edge(0.525, 0.0012), "turn_1"),
        (edge(0.58, 0.0562), "turn_17"),
        (edge(0.61, 0.05), "clear"),
        (edge(0.61, 0.08), "over"),
    ],
)
def test_first_sub_goal(tip: np.ndarray, first: str) -> None:
    """By where the blade is."""
    goals = TASK.sub_goals(FLAT, tip)
    assert goals[0].name == first
    assert goals[-1].name == "turn_19"


@pytest.mark.parametrize(
    ("before_rim", "aside", "first"),
    [
        (0.028, 0.003, "under"),
        (0.028, 0.006, "behind"),  # an estimate went aside before the rim: the blade follows it on the table
        (0.016, 0.020, "behind"),
        (0.012, 0.020, "clear"),
        (-0.020, 0.006, "under"),
        (-0.020, 0.017, "under"),
        (-0.020, 0.020, "clear"),
    ],
)
def test_a_low_blade_goes_up_for_nothing_that_it_can_follow(
    before_rim: float, aside: float, first: str
) -> None:
    """Up, over and down again costs a third of the hard task's actions; an image errs by 4 mm and more."""
    task = task_named("spatula_flipping_hard")
    flat = np.array([p.nominal for p in task.parameters()])
    rim = flat[0] - flat[5] * TASK.pancake_radius
    goals = task.sub_goals(flat, edge(rim - before_rim, 0.0015, aside))
    assert goals[0].name == first
    if first != "clear":
        assert abs(goals[0].tip_position[1]) < 1e-12 and goals[0].tip_position[2] < 0.002


def test_the_arc_goes_from_the_table_over_the_lip() -> None:
    """All sub-goals lie on the circle, one step apart."""
    places = [g.tip_position for g in TASK.sub_goals(FLAT, edge(0.525, 0.0012))]
    from_foot = np.array(places) - [TASK.lip_x, 0.0, TASK.low]
    np.testing.assert_allclose(np.linalg.norm(from_foot, axis=1), TASK.arc_radius)
    assert places[-1][0] > TASK.lip_x


def test_no_action_ends_where_the_hard_pancake_stands_by_itself() -> None:
    """From wherever the edge has come to on its arc, straight steps lead past those angles, in one action."""
    task = task_named("spatula_flipping_hard")
    assert isinstance(task, SpatulaFlipping)
    low, high = task.upright
    flat = np.array([p.nominal for p in task.parameters()])
    for start in np.linspace(0.0, low, 60):
        radius = task.arc_radius
        tip = np.array([task.lip_x - radius * math.cos(start), 0.0, task.low + radius * math.sin(start)])
        angle = start
        while goals := task.sub_goals(flat, tip):
            way = goals[0].tip_position - tip
            tip = tip + way * min(1.0, goals[0].max_step / float(np.linalg.norm(way)))
            angle, before = math.atan2(tip[2] - task.low, task.lip_x - tip[0]), angle
            assert angle > before
            assert not low + 1e-3 < angle < high - 1e-3, f"from {start} rad it waits at {angle} rad"
            if angle > high:
                break
        assert goals and task.action_limit < 0.02


def test_an_upright_range_must_rise() -> None:
    """Within the arc."""
    with pytest.raises(InputError, match=r"upright is \(1.4, 1.2\) rad"):
        SpatulaFlipping(upright=(1.4, 1.2))


@pytest.mark.parametrize(
    ("values", "peak", "speed", "success"),
    [
        (TURNED, 0.05, 0.0, True),
        (TURNED, 0.02, 0.0, False),
        (TURNED, 0.05, 0.03, False),
        (FLAT, 0.05, 0.0, False),
        (np.array([0.6, 0, 0.014, 0, math.pi - 0.4]), 0.05, 0.0, True),
        (np.array([0.6, 0, 0.014, 0, math.pi - 0.5]), 0.05, 0.0, False),
    ],
)
def test_success(values: np.ndarray, peak: float, speed: float, success: bool) -> None:
    """On its other face, lifted, at rest."""
    assert TASK.succeeded(ended(values, peak, speed)) is success


def test_done_by_the_estimate() -> None:
    """Turned and lying; not while it stands on its rim; then no goal is left."""
    tip = edge(0.6, 0.05)
    assert TASK.is_done(TURNED, tip) and TASK.sub_goals(TURNED, tip) == ()
    assert not TASK.is_done(FLAT, tip)
    assert not TASK.is_done(np.array([0.6, 0, 0.03, 0, math.pi - 0.4]), tip)


def test_final_error_is_the_way_of_the_rim() -> None:
    """Half the circumference at first, nothing at the end."""
    assert TASK.final_error(ended(FLAT)) == pytest.approx(math.pi * 0.05)
    assert TASK.final_error(ended(TURNED)) == pytest.approx(0.0, abs=1e-6)


def test_bad_input_is_refused() -> None:
    """Estimates, tips and settings."""
    with pytest.raises(InputError, match="tilt_x"):
        TASK.body_poses(np.zeros(4))
    with pytest.raises(InputError, match="tilt_x"):
        TASK.chain_angles(np.full(5, np.nan))
    with pytest.raises(InputError, match="tip"):
        TASK.is_done(FLAT, np.array([0.0, np.nan, 0.0]))
    with pytest.raises(InputError, match="lip"):
        SpatulaFlipping(pancake_radius=0.08)
    with pytest.raises(InputError, match="rounding"):
        SpatulaFlipping(pancake_rounding=0.006)
    with pytest.raises(InputError, match="pancake_mass"):
        SpatulaFlipping(pancake_mass=-0.1)
    for bad in ((0.01, math.nan), (0.01, 0.0), (0.01,), (0.01, 0.01, 0.01), (math.inf, 0.01)):
        with pytest.raises(InputError, match="half_range"):
            SpatulaFlipping(half_range=bad)
    with pytest.raises(InputError, match="lengthen the lip"):
        SpatulaFlipping(half_range=(0.01, 0.08))
