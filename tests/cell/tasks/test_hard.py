"""Hard variants: parts as made stay within their fits, force is judged, and the model has the drawing."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.instance.cell_instance import instance_named
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import HARD_TASKS, TASKS, plain_name
from samrl_core.cell.tasks.needle_threading.task import NEEDLE, NeedleThreading
from samrl_core.cell.tasks.peg_insertion.task import BODY, PegInsertion
from samrl_core.cell.tasks.spatula_flipping.task import PANCAKE, SpatulaFlipping
from samrl_core.cell.tasks.task import Ending, Task
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError

CELL = cell_named()
EVERY = pytest.mark.parametrize("task", HARD_TASKS.values(), ids=lambda task: task.name)


def peg() -> PegInsertion:
    task = HARD_TASKS["peg_insertion_hard"]
    assert isinstance(task, PegInsertion)
    return task


def flipping() -> SpatulaFlipping:
    task = HARD_TASKS["spatula_flipping_hard"]
    assert isinstance(task, SpatulaFlipping)
    return task


def threading() -> NeedleThreading:
    task = HARD_TASKS["needle_threading_hard"]
    assert isinstance(task, NeedleThreading)
    return task


def made(task: Task, count: int = 60) -> list[Task]:
    return [task.as_made(instance_named(f"typical:{k}", CELL).parts) for k in range(count)]


def inserted(task: PegInsertion, values: np.ndarray, depth: float, force: float) -> bool:
    """Whether a tip on the hole's axis at a depth below its mouth [m] is a success."""
    block = task.body_poses(values)[BODY]
    tip = block.apply(np.array([0.0, 0.0, task.height - depth]))
    return task.succeeded(Ending({BODY: block}, {}, {}, tip, np.zeros((0, 3)), force))


@EVERY
def test_a_variant_is_its_plain_task_with_other_settings(task: Task) -> None:
    plain = TASKS[plain_name(task.name)]
    assert type(task) is type(plain) and task.max_actions < plain.max_actions
    assert task.action_limit >= plain.action_limit  # so that its networks may act here


def test_fits_spread_over_two_to_five_tenths_of_a_millimetre() -> None:
    """Peg and hole are made apart: pairs of typical cells fill the range, none is outside."""
    clearances = np.array([one.clearance for one in made(peg()) if isinstance(one, PegInsertion)])
    assert clearances.min() >= 0.0002 and clearances.max() <= 0.0005
    assert np.quantile(clearances, 0.1) < 0.00028 and np.quantile(clearances, 0.9) > 0.00042
    worst = [peg().as_made(instance_named(f"careless:{k}", CELL).parts) for k in range(30)]
    assert all(0.0002 <= one.clearance <= 0.0005 for one in worst)


def test_a_block_leans_about_its_mouth_and_the_values_say_how() -> None:
    """Mouth where the first two values say, as high as that of a standing block; the inverse is exact."""
    values = np.array([0.52, -0.03, math.radians(1.5), math.radians(-1.0)])
    pose = peg().body_poses(values)[BODY]
    np.testing.assert_allclose(
        pose.apply(np.array([0.0, 0.0, peg().height])), [0.52, -0.03, 0.04], atol=1e-12
    )
    lean = math.degrees(math.acos(pose.rotation[2, 2]))
    assert lean == pytest.approx(math.hypot(1.5, 1.0), rel=1e-3)
    np.testing.assert_allclose(peg().values_at({BODY: pose}, np.zeros(0)), values, atol=1e-12)


def test_a_turned_block_has_the_same_values() -> None:
    """How it is turned about its axis is the world's own, and differs from episode to episode."""
    draws = [peg().sample_start(np.random.default_rng(k)).body_in_world[BODY] for k in range(20)]
    yaws = [math.degrees(math.atan2(pose.rotation[1, 0], pose.rotation[0, 0])) for pose in draws]
    assert max(yaws) > 8.0 and min(yaws) < -8.0 and max(np.abs(yaws)) < 15.1
    for k, pose in enumerate(draws):
        expected = peg().start_values(np.random.default_rng(k))
        np.testing.assert_allclose(peg().values_at({BODY: pose}, np.zeros(0)), expected, atol=1e-9)


def test_sub_goals_follow_the_axis_of_a_leaning_hole() -> None:
    """Hover and end lie on the axis; 25 mm below the mouth a lean of 1.5 deg is 0.65 mm aside."""
    values = np.array([0.5, 0.0, 0.0, math.radians(1.5)])
    above, inside = peg().sub_goals(values, np.array([0.5, 0.0, 0.2]))
    aside = math.sin(math.radians(1.5))
    np.testing.assert_allclose(above.tip_position[0], 0.5 + aside * peg().hover, atol=1e-9)
    np.testing.assert_allclose(inside.tip_position[0], 0.5 - aside * peg().goal_depth, atol=1e-9)
    assert peg().is_done(values, inside.tip_position)


@pytest.mark.parametrize(
    ("depth", "force", "success"), [(0.021, 41.0, True), (0.021, 43.0, False), (0.019, 0.0, False)]
)
def test_a_peg_that_slips_in_the_fingers_has_failed(depth: float, force: float, success: bool) -> None:
    values = np.array([0.48, 0.02, 0.02, -0.01])
    assert inserted(peg(), values, depth, force) is success
    plain = replace(peg(), force_limit=math.inf)
    assert inserted(plain, values, depth, force) is (depth > 0.02)


def test_a_small_pancake_is_approached_at_its_own_rim() -> None:
    """Of two sizes neither is assumed before an image; the plain task has one, and no such parameter."""
    task, start = flipping(), np.array([0.385, 0.0, 0.02])
    middle = [p.nominal for p in task.parameters()]
    assert [p.name for p in task.parameters()][5:] == ["pancake_size", "camera_x", "camera_y", "camera_z"]
    assert middle[5] == pytest.approx(0.9)
    behind = {}
    for size in (0.8, 1.0):
        goal = task.sub_goals(np.array([*middle[:5], size, 0.0, 0.0, 0.0]), start)[0]
        behind[size] = float(goal.tip_position[0])
    assert behind[0.8] - behind[1.0] == pytest.approx(0.2 * task.pancake_radius)
    turned = task.look_alikes(np.array([*middle[:5], 0.83, 0.001, 0.0, 0.0]))[0]
    assert turned[5] == 0.83 and turned[6] == 0.001
    assert len(TASKS["spatula_flipping"].parameters()) == 5
    with pytest.raises(InputError, match=r"size \[-\], camera x, y, z"):
        task.body_poses(np.zeros(5))


def test_a_pancake_behind_the_lip_has_fallen_over_it() -> None:
    """And is done however high its plate lies, or is shown; the plain task asks colours alone."""
    task, start = flipping(), np.array([0.385, 0.0, 0.02])
    rest = [1.0, 0.0, 0.0, 0.0]
    flat, turned = (np.array([0.600, 0.0, 0.033, 0.0, tilt, *rest]) for tilt in (0.2, math.pi - 0.2))
    before = np.array([0.545, 0.0, 0.006, 0.0, 0.1, *rest])
    assert not task.is_possible(flat) and task.is_possible(turned) and task.is_possible(before)
    assert task.is_done(turned, start) and not task.is_done(flat, start)
    assert not task.is_done(turned + [0.0, 0.0, 0.020, *np.zeros(6)], start), "held up by the blade"
    assert TASKS["spatula_flipping"].is_possible(flat[:5])


def test_pancakes_of_both_sizes_come_and_lie_clear_of_the_lip() -> None:
    radii = np.array([one.pancake_radius for one in made(flipping()) if isinstance(one, SpatulaFlipping)])
    small = radii < 0.045
    assert 15 < small.sum() < 45
    np.testing.assert_allclose(radii[small], 0.040, rtol=0.031)
    np.testing.assert_allclose(radii[~small], 0.050, rtol=0.031)
    reach = flipping().start_range[1][0] + radii.max()
    assert reach < flipping().lip_x


def test_plates_are_higher_or_lower_by_cell_and_all_lies_on_them() -> None:
    """A model has the drawn one, an expert who is told has all goals higher."""
    task, start = flipping(), np.array([0.385, 0.0, 0.03])
    plates = [one for one in made(task) if isinstance(one, SpatulaFlipping)]
    heights = np.array([one.surface_height for one in plates])
    assert np.abs(heights).max() <= 0.005 and np.ptp(heights) > 0.008 and task.surface_height == 0.0
    shift = [p.scale for p in task.parameters() if p.kind == "camera"]
    assert shift[0] == shift[1] < shift[2]
    for one in plates[:3]:
        lies = [body.body_in_world.position[2] - one.surface_height for body in one.scene(CELL).bodies]
        np.testing.assert_allclose(lies, [0.5 * one.pancake_thickness, 0.5 * one.lip_size[2]], atol=1e-12)
        drawn = replace(one, surface=0.0)
        up = np.array([0.0, 0.0, one.surface_height])
        values = one.start_values(np.random.default_rng(0))
        low = values - np.eye(len(values))[2] * one.surface_height
        for goal, other in zip(one.sub_goals(values, start + up), drawn.sub_goals(low, start), strict=True):
            np.testing.assert_allclose(goal.tip_position - up, other.tip_position, atol=1e-12)
    plain = TASKS["spatula_flipping"].as_made(instance_named("typical:1", CELL).parts)
    assert plain.surface_height == 0.0


def test_too_much_force_spoils_a_flip() -> None:
    """A blade of nylon bends."""
    pose = Pose(np.array([0.6, 0.0, 0.006]), np.array([0.0, 1.0, 0.0, 0.0]))
    for force, success in ((9.0, True), (11.0, False)):
        ending = Ending(
            {PANCAKE: pose}, {PANCAKE: 0.0}, {PANCAKE: 0.05}, np.zeros(3), np.zeros((0, 3)), force
        )
        assert flipping().succeeded(ending) is success


def test_needles_stand_within_two_centimetres_and_eyes_are_three_to_four_millimetres() -> None:
    places = np.array(
        [
            threading().sample_start(np.random.default_rng(k)).body_in_world[NEEDLE].position
            for k in range(200)
        ]
    )
    offset = places - threading().eye
    assert (
        np.abs(offset[:, :2]).max() <= 0.010
        and (offset[:, :2].max(0) > 0.009).all()
        and not offset[:, 2].any()
    )
    some = [one for one in made(threading()) if isinstance(one, NeedleThreading)]
    radii, lengths, stiffness = (
        np.array([getattr(t, n) for t in some]) for n in ("eye_radius", "link_length", "stiffness")
    )
    assert radii.min() >= 0.003 and radii.max() <= 0.004 and np.ptp(radii) > 0.0004
    assert np.ptp(lengths) > 0.0012 and stiffness.max() / stiffness.min() > 2.0


def test_a_needle_that_was_found_moves_goals_and_scene_alike() -> None:
    task = threading().with_needle_at(np.array([0.507, -0.004]))
    needle = next(body for body in task.scene(CELL).bodies if body.name == NEEDLE)
    np.testing.assert_allclose(needle.body_in_world.position, [0.507, -0.004, task.eye_z])
    tip = np.array([0.5, 0.0, 0.3])
    above = task.sub_goals(np.zeros(20), tip)[0]
    np.testing.assert_allclose(above.tip_position[:2], [0.507, -0.004], atol=1e-12)


def needle_values(place: tuple[float, float], length: float = 1.0) -> np.ndarray:
    """A straight thread, and a needle that stands there [m]."""
    return np.concatenate([np.zeros(20), place, [0.05, length], np.zeros(3)])


def test_an_unknown_needle_is_a_parameter_that_moves_body_and_goals() -> None:
    task, values = threading(), needle_values((0.507, -0.004))
    assert [p.kind for p in task.parameters()] == ["state"] * 20 + ["constant"] * 4 + ["camera"] * 3
    needle = task.body_poses(values)[NEEDLE]
    np.testing.assert_allclose(needle.position, [0.507, -0.004, task.eye_z])
    np.testing.assert_allclose(task.values_at({NEEDLE: needle}, np.zeros(20)), values, atol=1e-12)
    tip = np.array([0.5, 0.0, 0.3])
    above = task.sub_goals(values, tip)[0]
    np.testing.assert_allclose(above.tip_position[:2], [0.507, -0.004], atol=1e-12)
    np.testing.assert_allclose(task.aim(values, tip), [-0.007, 0.004], atol=1e-12)


def test_a_bent_threads_end_is_taken_into_the_eye_before_its_bend() -> None:
    """The next point of a thread that ends aslant would draw the end aside before it has entered."""
    task, values = threading(), needle_values((0.5, 0.0))
    values[:20] = np.tile([0.0, 0.08], 10)
    for height, first in ((0.012, "enter"), (0.006, "enter"), (0.001, "thread_1")):
        end = task.thread_points(values, np.zeros(3))[-1]
        tip = task.eye_at(values) - end + [0.0, 0.0, height]
        goals = task.sub_goals(values, tip)
        assert goals[0].name == first
        straight_down = goals[0].tip_position - tip
        assert bool(np.abs(straight_down[:2]).max() < 1e-9) is (first == "enter")


@pytest.mark.parametrize("aside", [0.0, 0.0012])
def test_the_aim_is_needed_where_the_end_enters_and_nowhere_else(aside: float) -> None:
    """At the hover an end 1.2 mm aside is over the eye to the sub-goal's tolerance, and enters next, too."""
    task, values = threading(), needle_values((0.5, 0.0))
    for height, needed in ((0.05, False), (0.012, True), (0.006, True), (-0.008, False)):
        end = task.thread_points(values, np.zeros(3))[-1]
        tip = task.eye_at(values) - end + [aside, 0.0, height]
        assert task.needs_aim(values, tip) is needed
    plain = TASKS["needle_threading"]
    assert not plain.needs_aim(np.zeros(20), tip)


def test_an_end_that_is_sent_aside_near_the_eye_is_looked_at_from_elsewhere_first() -> None:
    """In `careless:1` one image sent it aside, the next view denied it: three actions there and back."""
    task, values = threading(), needle_values((0.5, 0.0))
    over = task.eye_at(values) - task.thread_points(values, np.zeros(3))[-1]
    for height, needed in ((0.002, True), (0.012, True), (0.03, False)):
        tip = over + [0.006, 0.0, height]
        assert task.sub_goals(values, tip)[0].name == "above"
        assert task.needs_aim(values, tip) is needed


@pytest.mark.parametrize(("lean", "drawn"), [(0.02, 0.0), (0.05, 0.0009)])
def test_an_end_that_is_hardly_in_is_drawn_aside_no_more_than_it_must(lean: float, drawn: float) -> None:
    """`careless:4`: believed 0.6 mm above the eye and 3 mm in truth, it was drawn 1.4 mm, onto the ring."""
    task, values = threading(), needle_values((0.5, 0.0))
    values[:20] = np.tile([0.0, lean], 10)
    tip = task.eye_at(values) - task.thread_points(values, np.zeros(3))[-1] + [0.0, 0.0, 0.0006]
    goal = task.sub_goals(values, tip)[0]
    assert goal.name == "thread_1"
    assert np.linalg.norm((goal.tip_position - tip)[:2]) == pytest.approx(drawn, abs=1e-4)


def test_an_end_that_an_image_shows_a_little_aside_enters_aslant() -> None:
    """Images move the eye by a millimetre; an end at the hover was sent aside and up again by each."""
    task, values = threading(), needle_values((0.5, 0.0))
    end = task.thread_points(values, np.zeros(3))[-1]
    for aside, height, first in ((0.002, 0.011, "enter"), (0.0015, 0.004, "enter"), (0.004, 0.012, "above")):
        tip = task.eye_at(values) - end + [aside, 0.0, height]
        assert task.sub_goals(values, tip)[0].name == first


@pytest.mark.parametrize(("height", "up"), [(0.009, 0.0), (0.003, 0.003), (-0.002, 0.008), (0.03, -0.018)])
def test_an_end_beside_the_eye_goes_aside_where_it_is_clear_of_the_ring(height: float, up: float) -> None:
    """It was taken up to the hover, from which three actions lead down again."""
    task, values = threading(), needle_values((0.5, 0.0))
    tip = task.eye_at(values) - task.thread_points(values, np.zeros(3))[-1] + [0.008, 0.0, height]
    goals = {goal.name: goal.tip_position - tip for goal in task.sub_goals(values, tip)}
    np.testing.assert_allclose(goals["above"], [-0.008, 0.0, up], atol=1e-9)
    assert ("clear" in goals) is (height < 0.0)


def test_a_thread_is_held_by_its_eye_once_it_is_surely_in() -> None:
    task, values = threading(), needle_values((0.5, 0.0))
    over = task.eye_at(values) - task.thread_points(values, np.zeros(3))[-1]
    held = [task.held_within(values, over + [aside, 0.0, -deep]) for aside, deep in
            ((0.0, 0.008), (0.0, 0.004), (0.005, 0.008))]  # fmt: skip
    assert held == [pytest.approx(task.eye_radius - task.thread_radius), np.inf, np.inf]
    assert TASKS["needle_threading"].held_within(np.zeros(20), over - [0.0, 0.0, 0.008]) == np.inf


def test_a_longer_thread_stops_higher_above_the_eye() -> None:
    task, tip = threading(), np.array([0.5, 0.0, 0.3])
    drawn, longer = (task.sub_goals(needle_values((0.5, 0.0), s), tip)[0] for s in (1.0, 1.06))
    assert longer.tip_position[2] - drawn.tip_position[2] == pytest.approx(0.006, abs=1e-9)


def test_a_believed_length_is_drawn_into_the_links_and_read_back() -> None:
    task, values = threading(), needle_values((0.5, 0.0), 1.061)
    believed = task.as_believed(values)
    assert believed.link_length == pytest.approx(1.06 * task.link_length)
    assert believed.values_at(believed.body_poses(values), np.zeros(20))[23] == pytest.approx(1.06)
    assert believed.chain_stretch(values) == pytest.approx(1.061 / 1.06)
    assert task.as_believed(needle_values((0.5, 0.0), 1.004)) == task


def test_truth_is_read_as_length_and_place_of_the_needle() -> None:
    task, values = threading(), needle_values((0.492, 0.006), 0.95)
    points = task.thread_points(values, np.array([0.5, 0.0, 0.3]))
    found = task.values_from_truth(task.body_poses(values), points)
    np.testing.assert_allclose(found, values, atol=1e-9)


@pytest.mark.parametrize("level", ["typical", "careless"])
def test_a_threads_length_is_within_its_bounds_whoever_set_up_the_cell(level: str) -> None:
    """What is out of bounds no image can find: it goes into the thread's shape."""
    task = threading()
    made = [task.as_made(instance_named(f"{level}:{k}", CELL).parts) for k in range(60)]
    share = np.array([one.link_length for one in made]) / task.link_length
    length = next(p for p in task.parameters() if p.name == "thread_length")
    assert length.lower < share.min() and share.max() < length.upper


def test_a_wrong_number_of_values_names_what_is_expected() -> None:
    with pytest.raises(InputError, match="7 numbers of needle, length and camera"):
        threading().body_poses(np.zeros(20))
    with pytest.raises(InputError, match="length_range"):
        replace(threading(), length_range=0.0)


@pytest.mark.parametrize(
    ("change", "word"),
    [({"fits": (0.0004, 0.0005)}, "fits"), ({"tilt": -0.1}, "tilt"), ({"force_limit": 0.0}, "force_limit")],
)
def test_impossible_settings_are_refused(change: dict, word: str) -> None:
    with pytest.raises(InputError, match=word):
        replace(peg(), **change)
    with pytest.raises(InputError, match="small_radius"):
        replace(flipping(), small_radius=0.06)
    with pytest.raises(InputError, match="eyes"):
        replace(threading(), eyes=(0.004, 0.005))
