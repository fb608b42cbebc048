"""Which belief about its cell an agent's model is updated by, as images choose it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.calibration.seen_error import EXACTLY_SEEN
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.tasks.needle_threading.task import NeedleThreading
from samrl_core.cell.types.camera import Camera
from samrl_core.cell.types.observation import Observation
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.common.errors import InputError
from samrl_core.model.model import Model
from samrl_core.model.real2sim.prediction import CameraErrors
from samrl_core.model.real2sim.real2sim import Estimate, Real2Sim, initial_estimate
from samrl_core.policy.agent.beliefs import BeliefChoice, ChoiceSettings, Moved, uncalibrated_belief
from samrl_core.policy.agent.settings import no_log
from samrl_core.studies.episodes.cell_driver import CellDriver

CELL = cell_named()
NAMED = task_named("needle_threading_hard")
assert isinstance(NAMED, NeedleThreading)
TASK: NeedleThreading = NAMED
LENGTH = 23
FAR = (0.004, 0.012, 0.010)  # beside where a calibrated camera would be [m]


@pytest.fixture(scope="module")
def model() -> Model:
    return Model(TASK, CELL)


@pytest.fixture(scope="module")
def seen() -> Iterator[Observation]:
    yield start_view(TASK)


def start_view(made: NeedleThreading) -> Observation:
    """The image that an episode starts with, in a nominal cell with parts made so."""
    world = PyBulletWorld(made, CELL)
    world.reset(3)
    found = CellDriver(world, CELL, world.scene.tool).observe()
    world.close()
    return found


def shown_beside(seen: Observation, way: tuple[float, float, float]) -> Observation:
    """The same image, of a camera that is believed so far beside where it is [m]."""
    pose = seen.camera.camera_in_world
    moved = Pose(pose.position + np.array(way), pose.quat_xyzw)
    return replace(seen, camera=Camera(seen.camera.intrinsics, moved))


FIRST = Moved(None, 0.0, 0.0, CameraErrors())
STILL = CameraErrors(0.0, 0.0)


def after(choice: BeliefChoice, seen: Observation, images: int = 1) -> Estimate:
    """What is believed after so many times the same image, from the beginning of an episode."""
    estimate, tip = choice.begin(EXACTLY_SEEN), np.zeros(3)
    for number in range(images):
        moved = Moved((tip, tip), 0.0, 0.0, STILL) if number else FIRST
        estimate = choice.update(estimate, seen, moved, no_log)
    return estimate


def test_a_cell_that_is_its_model_keeps_the_usual_belief(model: Model, seen: Observation) -> None:
    """What is believed stays bit for bit what it was."""
    choice = BeliefChoice(model)
    found, usual = after(choice, seen), Real2Sim(model).update(initial_estimate(model), seen)
    assert not choice.uncalibrated and choice.evidence < 0.0
    np.testing.assert_array_equal(found.values, usual.values)
    np.testing.assert_array_equal(found.covariance, usual.covariance)
    np.testing.assert_array_equal(found.colors, usual.colors)


def test_only_the_first_images_choose(model: Model, seen: Observation) -> None:
    """Later ones show what contact did, too; and the second belief is followed no further."""
    choice = BeliefChoice(model, ChoiceSettings(images=1))
    estimate, tip = after(choice, seen), np.zeros(3)
    evidence = choice.evidence
    choice.update(estimate, shown_beside(seen, FAR), Moved((tip, tip), 0.0, 0.0, STILL), no_log)
    assert not choice.uncalibrated and choice.evidence == evidence


def test_a_camera_that_is_far_off_brings_the_wider_belief(model: Model, seen: Observation) -> None:
    choice = BeliefChoice(model)
    found = after(choice, shown_beside(seen, FAR), 2)
    assert choice.uncalibrated and choice.evidence > ChoiceSettings().evidence
    np.testing.assert_allclose(np.linalg.norm(found.values[24:27]), np.linalg.norm(FAR), atol=0.006)
    choice.begin(EXACTLY_SEEN)
    assert not choice.uncalibrated  # another episode begins as every one


def test_a_thread_beyond_what_calibrated_cells_have_brings_the_wider_belief(model: Model) -> None:
    """A quarter shorter than drawn; the usual belief ends at its bound."""
    short = start_view(replace(TASK, link_length=0.77 * TASK.link_length))
    choice = BeliefChoice(model)
    found = after(choice, short, 3)
    assert choice.uncalibrated
    assert found.values[LENGTH] < TASK.parameters()[LENGTH].lower
    assert found.values[LENGTH] == pytest.approx(0.77, abs=0.06)


def test_images_that_no_fit_settles_in_choose_nothing(model: Model, seen: Observation) -> None:
    """The needle's label is on the table."""
    mask = seen.frame.mask.copy()
    mask[mask == TASK.needle_label] = 0
    mask[95:115, 20:45] = TASK.needle_label
    wrong = replace(seen, frame=replace(seen.frame, mask=mask))
    choice = BeliefChoice(model)
    after(choice, shown_beside(wrong, FAR))
    assert not choice.uncalibrated


class Told(Real2Sim):
    """A fit that answers what it is told to."""

    def __init__(self, answer: Estimate) -> None:
        """No model is asked."""
        self._answer = answer

    def update(
        self,
        estimate: Estimate,
        observation: Observation,
        watch: Callable[[np.ndarray], None] | None = None,
        compared: bool = True,
    ) -> Estimate:
        """The answer."""
        return self._answer


@pytest.mark.parametrize(
    ("settled", "aside", "kept"), [(False, 0.006, True), (True, 0.006, False), (False, 0.002, False)]
)
def test_what_has_entered_stays_in_unless_a_fit_settles(
    model: Model, seen: Observation, settled: bool, aside: float, kept: bool
) -> None:
    """Where no part fits, an image shows the thread beside the eye that it hangs in: it would go up again."""
    belief = uncalibrated_belief(model)
    assert belief is not None
    first = belief.initial(EXACTLY_SEEN)
    end = TASK.thread_points(first.values, np.zeros(3))[-1]
    tip = TASK.eye_at(first.values) - end - [0.0, 0.0, 0.008]
    shown = first.values.copy()
    shown[20] += aside  # the eye
    answer = replace(first, values=shown, converged=settled)
    told = replace(belief, real2sim=Told(answer))
    found = told.update(first, seen, Moved((tip, tip), 0.0, 0.0, STILL), no_log)
    np.testing.assert_array_equal(found.values, first.values if kept else shown)


def test_a_task_that_makes_no_difference_has_one_belief() -> None:
    peg = Model(task_named("peg_insertion"), CELL)
    assert uncalibrated_belief(peg) is None


def test_a_belief_in_other_parameters_is_refused(model: Model) -> None:
    with pytest.raises(InputError, match="another belief may differ in scales and bounds alone"):
        model.believing(replace(TASK, eye_x=0.52))
