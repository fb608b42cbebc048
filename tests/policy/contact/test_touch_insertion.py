"""An agent's sense of touch: what it believes of the hole, what it keeps, and a peg in a simulated cell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.control.tip_sense import TipReading
from samrl_core.cell.instance.cell_instance import instance_named
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.observation import ArmReading, Observation
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.world.evaluation import ending_now, true_values
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.common.errors import InputError
from samrl_core.model.model import Model
from samrl_core.model.real2sim.real2sim import Estimate, initial_estimate
from samrl_core.model.real2sim.tip_offset import TipOffset
from samrl_core.policy.agent.settings import AgentSettings
from samrl_core.policy.contact.insertion import BOTTOM, FORCED, begin
from samrl_core.policy.contact.touch_insertion import TouchInsertion, TouchSettings, require_peg
from samrl_core.studies.episodes.world_plant import WorldPlant

CELL, TASK = cell_named(), require_peg(task_named("peg_insertion_hard"))
BLIND = TouchSettings(sights=False)  # to colours: the images of these tests have none
HERE = TASK.start_camera()
JOINTS = TASK.start_joints(CELL)["tool_arm"]


@pytest.fixture(scope="module")
def nothing_known() -> Estimate:
    return initial_estimate(Model(TASK, CELL))


def believed(estimate: Estimate, values: tuple[float, ...], deviation: float = 0.0002) -> Estimate:
    return replace(estimate, values=np.array(values), covariance=deviation**2 * np.eye(4))


def offset_of(x: float, y: float) -> TipOffset:
    return TipOffset(np.array([x, y, 0.0, 0.0]), 0.0003**2 * np.eye(4), HERE, 9)


class Sight:
    """As much of an observation as touch reads."""

    def __init__(self, stamp_ns: int, arm: ArmReading, camera: Pose = HERE) -> None:
        self.stamp_ns, self.tool_arm = stamp_ns, arm
        self.camera = type("Camera", (), {"camera_in_world": camera})


def sight(stamp_ns: int, camera: Pose = HERE) -> Observation:
    return Sight(stamp_ns, ArmReading(0, JOINTS, np.zeros(7), np.zeros(7)), camera)  # ty: ignore[invalid-explicit-return]


def test_the_hole_is_seen_from_the_tip_that_the_camera_sees(nothing_known: Estimate) -> None:
    touch = TouchInsertion(TASK, CELL, BLIND)
    touch.see(believed(nothing_known, (0.51, -0.02, 0.0, 0.02)), sight(1), offset_of(0.0, 0.0))
    mouth = touch.mouth(offset_of(0.002, -0.001))
    np.testing.assert_allclose(mouth.place, [0.508, -0.019])
    np.testing.assert_allclose(mouth.lean, [np.tan(0.02), 0.0], atol=1e-12)  # about y it leans along x
    spread = 0.0002**2 + 0.0003**2 + TouchSettings().memory.unknown ** 2
    np.testing.assert_allclose(mouth.covariance, spread * np.eye(2))


def test_doubt_widens_what_images_are_believed_to_be_wrong_by(nothing_known: Estimate) -> None:
    spreads = []
    for doubt in (1.0, 4.0):
        touch = TouchInsertion(TASK, CELL, BLIND.doubting(doubt))
        touch.see(believed(nothing_known, (0.51, 0.0, 0.0, 0.0)), sight(0), offset_of(0.0, 0.0))
        mouth = touch.mouth(offset_of(0.0, 0.0))
        spreads.append((mouth.covariance[0, 0], mouth.reach))
    more = 15.0 * TouchSettings().memory.unknown ** 2
    np.testing.assert_allclose(spreads[1], (spreads[0][0] + more, 4.0 * spreads[0][1]))
    with pytest.raises(InputError, match="within 1..10"):
        AgentSettings(policy="optimised", tip_offset=True, touch=True, doubt=0.5)


def test_one_image_that_is_off_by_a_centimetre_changes_little(nothing_known: Estimate) -> None:
    touch, seen = TouchInsertion(TASK, CELL, BLIND), offset_of(0.0, 0.0)
    for k, x in enumerate((0.510, 0.5104, 0.525, 0.5102, 0.5103)):
        touch.see(believed(nothing_known, (x, 0.0, 0.0, 0.0), 0.02 if k == 4 else 0.0002), sight(k), seen)
    touch.see(believed(nothing_known, (0.6, 0.0, 0.0, 0.0)), sight(4), seen)  # the same image again
    place = touch.mouth(offset_of(0.0, 0.0)).place
    np.testing.assert_allclose(place, [np.median([0.510, 0.5104, 0.525, 0.5102]), 0.0])
    there = Pose(HERE.position + [0.0, 0.0, 0.1], HERE.quat_xyzw)
    touch.see(believed(nothing_known, (0.512, 0.001, 0.0, 0.0)), sight(9, there), seen)
    np.testing.assert_allclose(touch.mouth(offset_of(0.0, 0.0)).place, [0.512, 0.001])


def test_a_hole_that_is_hardly_known_is_looked_at_again(nothing_known: Estimate) -> None:
    """The tip stands above it; as often as allowed it stays there, then it goes down all the same."""
    known = replace(BLIND, memory=replace(BLIND.memory, height=0.0003))  # the face need not be felt first
    touch = TouchInsertion(TASK, CELL, known)
    reading = ArmReading(0, JOINTS, np.zeros(7), np.zeros(7))
    tip = touch._sense.read(reading).tip
    vague = believed(nothing_known, (tip[0], tip[1], 0.0, 0.0), 0.003)
    low = replace(TASK, height=float(tip[2]) - 0.002)  # the block's face right below the tip
    touch._task = low
    names = [touch.move(vague, offset_of(0.0, 0.0), sight(k)).name for k in range(8)]
    waits = TouchSettings().most_waits
    assert names[:waits] == ["look"] * waits and names[waits] == "lowering"


def test_it_is_refused_where_there_is_no_peg_and_without_the_tips_offset() -> None:
    with pytest.raises(InputError, match="needle_threading has no peg"):
        TouchInsertion(task_named("needle_threading"), CELL)
    with pytest.raises(InputError, match="set tip_offset as well"):
        AgentSettings(policy="optimised", touch=True)


def test_a_typical_cells_peg_goes_in_gently_and_tells_how_wrong_the_images_were(
    nothing_known: Estimate,
) -> None:
    """Believed 1.5 mm beside where it is; PyBullet, clearance 0.39 mm, truth for the test alone."""
    world = PyBulletWorld(TASK, CELL, instance=instance_named("typical:0", CELL))
    plant = WorldPlant(world, TASK, CELL)
    plant.begin(7)
    touch, error = TouchInsertion(TASK, CELL, BLIND), np.array([0.0012, -0.0009])
    truth = true_values(TASK, world.truth())
    wrong = world.truth().tip_position[:2] - plant.tip()[:2]  # by the encoders' zeros and the grip
    belief = believed(nothing_known, (*(truth[:2] + error), *truth[2:]))
    plant.displace_tool(np.zeros(3))
    for step in range(TASK.max_actions):
        for _ in range(200):
            world.advance()
        move = touch.move(belief, offset_of(*wrong), Sight(step, world.read_arm("tool_arm")))
        if move.name == BOTTOM:
            break
        plant.displace_tool(move.displacement)
    ending = ending_now(world.truth())
    world.close()
    assert move.name == BOTTOM and TASK.succeeded(ending)
    assert ending.peak_contact_force < 25.0
    assert np.linalg.norm(touch.memory.error - error) < 0.0008 < np.linalg.norm(error)
    memory = touch.memory
    touch.begin_episode()
    assert touch.memory is memory and not touch.in_contact


def test_what_is_deep_below_a_felt_face_is_in_the_hole_wherever_images_have_that(
    nothing_known: Estimate,
) -> None:
    """Images put the hole 8 mm beside, and lean the block by 15 degrees."""
    wrong = believed(nothing_known, (0.51, 0.0, 0.26, 0.0))
    touch = TouchInsertion(TASK, CELL, BLIND)
    touch.see(wrong, sight(0), offset_of(0.0, 0.0))
    mouth, face = touch.mouth(offset_of(0.0, 0.0)), 0.043
    assert np.linalg.norm(mouth.lean) <= 2.0 * TASK.tilt + 1e-9
    free = TipReading(np.zeros(3), np.zeros(3), np.eye(3))
    state = replace(begin(mouth, free), phase="inside", touched=face, felt_face=True)
    for deep, done in ((0.020, False), (0.022, True)):
        touch._state = state
        tip = touch.tip(np.array([0.518, 0.0, face - deep]), wrong, offset_of(0.0, 0.0))
        assert TASK.is_done(wrong.values, tip) == done
        touch._state = replace(state, felt_face=False)
        tip = touch.tip(np.array([0.518, 0.0, face - deep]), wrong, offset_of(0.0, 0.0))
        assert not TASK.is_done(wrong.values, tip)


@pytest.mark.parametrize(("felt", "name"), [(41.0, BOTTOM), (43.0, FORCED)])
def test_a_peg_that_was_pressed_harder_than_the_task_allows_is_not_inserted(
    nothing_known: Estimate, felt: float, name: str
) -> None:
    touch, here = TouchInsertion(TASK, CELL, BLIND), believed(nothing_known, (0.5, 0.0, 0.0, 0.0))
    assert not touch.pressed_too_hard(sight(0))
    touch.see(here, sight(0), offset_of(0.0, 0.0))
    reading = touch._sense.read(sight(1).tool_arm)
    mouth = touch.mouth(offset_of(0.0, 0.0))
    deep = float(reading.tip[2]) + 0.022
    state = replace(begin(mouth, reading), phase="inside", touched=deep, felt_face=True, hardest=felt)
    touch._state = state
    assert touch.pressed_too_hard(sight(1)) == (name == FORCED)
    assert touch.move(here, offset_of(0.0, 0.0), sight(1)).name == name
    assert TASK.force_limit == 42.0
