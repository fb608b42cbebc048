"""A target of several labels: its parts, what moves them, and what stretches or shifts with the values."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.tasks.needle_threading.task import NEEDLE, NeedleThreading
from samrl_core.common.errors import InputError
from samrl_core.model.model import Model
from samrl_core.model.scene.chain_skin import CHAIN

CELL = cell_named()
TASK = task_named("needle_threading_hard")
THREAD, NEEDLE_PART = 0, 1
VALUES = np.concatenate([np.tile([0.05, -0.03], 10), [0.505, -0.004, 0.1, 1.06], [0.002, -0.001, 0.003]])


@pytest.fixture(scope="module")
def model() -> Model:
    return Model(TASK, CELL)


def test_thread_and_needle_are_parts_and_the_camera_moves_both(model: Model) -> None:
    assert isinstance(TASK, NeedleThreading)
    thread, needle = model.parts
    assert (thread.label, thread.frames) == (TASK.thread_label, {CHAIN})
    assert (needle.label, needle.frames) == (TASK.needle_label, {NEEDLE})
    assert thread.parameters.tolist() == [*range(20), 23, 24, 25, 26]
    assert needle.parameters.tolist() == [20, 21, 22, 24, 25, 26]
    assert thread.own.sum() == 21 and needle.own.sum() == 3
    assert model.target_label == TASK.thread_label  # what networks are shown


@pytest.mark.parametrize("part", [THREAD, NEEDLE_PART])
def test_points_move_as_the_surface_does(model: Model, part: int) -> None:
    """Against central differences of the rendered triangles, for every parameter."""
    joints = TASK.start_joints(CELL)["tool_arm"]
    middle = model.target_surface(VALUES, joints, part).mean(axis=1)
    motion = model.target_frames(VALUES, joints, part).motion(middle)
    for k, spec in enumerate(TASK.parameters()):
        step = np.zeros(len(VALUES))
        step[k] = 1e-4 * spec.scale
        ends = [model.target_surface(VALUES + s * step, joints, part).mean(axis=1) for s in (1, -1)]
        moved = (ends[0] - ends[1]) / (2 * step[k])
        # Triangles at a joint hang from two links, points from one.
        np.testing.assert_allclose(np.median(motion[:, :, k] - moved, axis=0), 0.0, atol=0.0015)


def test_the_camera_shows_all_beside_its_place_by_the_same(model: Model) -> None:
    joints, still = TASK.start_joints(CELL)["tool_arm"], VALUES.copy()
    still[24:] = 0.0
    for part in (THREAD, NEEDLE_PART):
        shift = model.target_surface(VALUES, joints, part) - model.target_surface(still, joints, part)
        np.testing.assert_allclose(shift, np.broadcast_to(VALUES[24:], shift.shape), atol=1e-9)


def test_physics_have_the_believed_length(model: Model) -> None:
    dynamics = model.dynamics_at(VALUES)
    tip = np.array([0.5, 0.0, 0.35])
    values, back = dynamics.read(dynamics.start(VALUES, tip).q[0].numpy())
    np.testing.assert_allclose(values[:22], VALUES[:22], atol=1e-12)
    assert values[23] == pytest.approx(1.06) and np.array_equal(back, tip)
    assert model.dynamics_at(VALUES) is dynamics


def test_labels_that_share_a_parameter_are_refused() -> None:
    class Tied(NeedleThreading):
        def chain_stretch(self, values: np.ndarray) -> float:
            return 1.0 + float(values[20]) - 0.5  # the needle's place bends the thread too

    assert isinstance(TASK, NeedleThreading)
    fields = {name: getattr(TASK, name) for name in TASK.__dataclass_fields__}
    with pytest.raises(InputError, match="parameters of their own"):
        Model(replace(Tied(**fields)), CELL)
