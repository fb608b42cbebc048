"""A pancake of unknown size: how its surface, its physics and the camera's shift follow from the values."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.tasks.spatula_flipping.task import SpatulaFlipping
from samrl_core.model.model import CACHED_SIZES, Model
from samrl_core.model.real2sim.prediction import predictions
from samrl_core.model.real2sim.real2sim import initial_estimate

CELL = cell_named()
TASK = task_named("spatula_flipping_hard")
JOINTS = TASK.start_joints(CELL)["tool_arm"]
SIZE = 5
VALUES = np.array([0.505, -0.004, 0.020, 0.2, -0.5, 0.83, 0.002, -0.001, 0.003])


@pytest.fixture(scope="module")
def model() -> Model:
    return Model(TASK, CELL)


def test_the_surface_is_as_large_as_believed_and_as_thick_as_drawn(model: Model) -> None:
    assert isinstance(TASK, SpatulaFlipping)
    flat = np.array([0.5, 0.0, 0.006, 0.0, 0.0, 0.83, 0.0, 0.0, 0.0])
    points = model.target_surface(flat, JOINTS).reshape(-1, 3)
    extent = points.max(axis=0) - points.min(axis=0)
    assert extent[0] == pytest.approx(2 * 0.83 * TASK.pancake_radius, rel=0.005)
    assert extent[2] == pytest.approx(TASK.pancake_thickness)
    flat[6:] = [0.002, -0.001, 0.003]
    shift = model.target_surface(flat, JOINTS).reshape(-1, 3) - points
    np.testing.assert_allclose(shift, np.broadcast_to(flat[6:], shift.shape), atol=1e-12)


def test_points_move_as_the_surface_does(model: Model) -> None:
    """Against central differences of the rendered triangles, for every parameter, size and shift included."""
    middle = model.target_surface(VALUES, JOINTS).mean(axis=1)
    motion = model.target_frames(VALUES, JOINTS).motion(middle)
    for k, spec in enumerate(TASK.parameters()):
        step = np.zeros(len(VALUES))
        step[k] = 1e-4 * spec.scale
        ends = [model.target_surface(VALUES + s * step, JOINTS).mean(axis=1) for s in (1, -1)]
        np.testing.assert_allclose(motion[:, :, k], (ends[0] - ends[1]) / (2 * step[k]), atol=1e-6)


def test_physics_have_the_believed_size_to_two_millimetres(model: Model) -> None:
    assert isinstance(TASK, SpatulaFlipping)
    believed = TASK.as_believed(VALUES)
    assert believed.pancake_radius == pytest.approx(0.84 * TASK.pancake_radius)
    dynamics = model.dynamics_at(VALUES)
    tip = np.array([0.4, 0.0, 0.05])
    values, _ = dynamics.read(dynamics.start(VALUES, tip).q[0].numpy())
    np.testing.assert_allclose(values[:5], VALUES[:5], atol=1e-9)
    assert values[SIZE] == pytest.approx(0.84)
    assert model.dynamics_at(VALUES) is dynamics and dynamics is not model.dynamics
    believed_sizes = [np.array([*VALUES[:SIZE], value, *VALUES[6:]]) for value in np.arange(0.8, 1.17, 0.04)]
    for values in believed_sizes:
        model.dynamics_at(values)
    assert len(model._dynamics_of) == CACHED_SIZES  # the sizes of all episodes would take 100 MB
    assert model.dynamics_at(VALUES) is not dynamics
    kept = model.dynamics_at(believed_sizes[-1])
    assert model.dynamics_at(believed_sizes[-1]) is kept
    for size in [p for p in TASK.parameters() if p.name == "pancake_size"]:
        for value in (size.lower, size.upper):  # any that a fit may say can be built
            TASK.as_believed(np.array([*VALUES[:SIZE], value, *VALUES[6:]]))


def test_a_push_moves_the_pancake_and_neither_its_size_nor_the_camera(model: Model) -> None:
    """The blade comes from 10 mm behind the rim of a small pancake and ends 4 mm past where it was."""
    assert isinstance(TASK, SpatulaFlipping)
    estimate = initial_estimate(model)
    estimate.values[:] = [0.500, 0.0, 0.006, 0.0, 0.0, 0.80, 0.002, 0.0, 0.0]
    rim = 0.500 - 0.040
    moved, *_ = predictions(
        model.dynamics_at(estimate.values),
        TASK.parameters(),
        estimate,
        np.array([rim - 0.006, 0.0, TASK.low]),
        np.array([rim + 0.004, 0.0, TASK.low]),
    )
    assert 0.001 < moved.values[0] - estimate.values[0] < 0.006
    np.testing.assert_allclose(moved.values[SIZE:], estimate.values[SIZE:])
    known = np.sqrt(np.diag(estimate.covariance)), np.sqrt(np.diag(moved.covariance))
    np.testing.assert_allclose(known[1][SIZE:], known[0][SIZE:], rtol=1e-6)
