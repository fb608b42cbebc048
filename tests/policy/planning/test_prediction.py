"""What is believed between two images: follows the tool through contact, and says how sure it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.tasks.needle_threading.task import NeedleThreading
from samrl_core.cell.tasks.peg_insertion.task import PegInsertion
from samrl_core.cell.tasks.spatula_flipping.task import SpatulaFlipping
from samrl_core.cell.tasks.task import Task
from samrl_core.common.errors import InputError
from samrl_core.model.real2sim.prediction import (
    PredictionSettings,
    camera_kept,
    likeliest,
    moved_by_contact,
    predictions,
)
from samrl_core.model.real2sim.real2sim import Estimate
from samrl_core.model.task_dynamics.choose import dynamics_of

CELL = cell_named()


def estimate(task: Task, values: np.ndarray, deviation: float) -> Estimate:
    """A belief with the same deviation for each parameter, in scales."""
    scale = np.array([p.scale for p in task.parameters()])
    nan = float("nan")
    return Estimate(
        names=tuple(p.name for p in task.parameters()),
        values=values,
        covariance=np.diag((deviation * scale) ** 2),
        color_names=(),
        colors=np.zeros((0, 3)),
        color_variance=np.zeros((0, 3)),
        stamp_ns=1,
        loss_before=nan,
        loss_after=nan,
        color_loss_before=nan,
        color_loss_after=nan,
        emd_before=nan,
        emd_after=nan,
        iterations=1,
        why_stopped="converged",
        converged=True,
    )


def test_a_pushed_pancake_is_expected_where_the_blade_left_it() -> None:
    """It goes along; how far it had been matters no more, how far aside still does."""
    task = SpatulaFlipping()
    before = estimate(task, np.array([0.512, 0.003, 0.006, 0.0, 0.0]), 0.1)
    start = np.array([0.456, 0.003, task.low])
    (after,) = predictions(
        dynamics_of(task, CELL), task.parameters(), before, start, start + np.array([0.012, 0.0, 0.0])
    )
    way = after.values[0] - before.values[0]
    assert 0.004 < way < 0.012
    assert after.values[1] == pytest.approx(0.003, abs=5e-4)
    scale = np.array([p.scale for p in task.parameters()])
    deviation = np.sqrt(np.diag(after.covariance))
    settings = PredictionSettings()
    own = np.hypot(settings.model_error * way, settings.held_error * scale[0])
    assert deviation[0] == pytest.approx(own, rel=0.1)
    assert deviation[1] > 0.08 * scale[1]
    assert np.linalg.eigvalsh(after.covariance).min() > 0
    np.testing.assert_allclose(after.covariance, after.covariance.T)


def test_a_thread_in_free_air_keeps_its_shape_and_its_errors() -> None:
    """Carried along slowly; nothing is learnt and nothing lost."""
    task = NeedleThreading()
    values = np.random.default_rng(0).uniform(-0.1, 0.1, 20)
    before = estimate(task, values, 0.3)
    start = task.eye + [0.0, 0.0, 0.15]
    (after,) = predictions(
        dynamics_of(task, CELL), task.parameters(), before, start, start + np.array([0.004, 0.0, 0.0])
    )
    np.testing.assert_allclose(after.values, values, atol=2e-3)
    grown = np.diag(after.covariance) / np.diag(before.covariance)
    assert (grown > 0.95).all() and (grown < 1.1).all()


def test_what_stands_on_edge_may_fall_or_not() -> None:
    """Pushed a little past upright on its rim, a pancake may lie on its other face or stand still; the image
    decides between the two.
    """
    task = SpatulaFlipping()
    before = estimate(task, np.array([0.577, 0.0, 0.0500, 0.0, 1.64]), 0.2)
    start = np.array([0.5760, 0.0, 0.0565])
    found = predictions(
        dynamics_of(task, CELL), task.parameters(), before, start, start + np.array([0.0055, 0.0, 0.0])
    )
    standing = [one for one in found if 1.2 < abs(one.values[4]) < 2.0 and one.values[2] > 0.045]
    lying = [one for one in found if one.values[2] < 0.03]
    assert standing and lying and len(found) <= 3
    assert all(np.linalg.eigvalsh(one.covariance).min() > 0 for one in found)
    losses = (0.4, float("nan"), 0.2)
    updates = [replace(before, loss_known=loss) for loss in losses]
    assert likeliest(updates) is updates[2]
    assert likeliest(updates[1:2]) is updates[1]


def test_a_fall_tells_nothing_new_of_size_and_camera() -> None:
    """An end apart from the likeliest one leaves the place of what stands on edge open, and not these."""
    task = task_named("spatula_flipping_hard")
    assert isinstance(task, SpatulaFlipping)
    scale = np.array([p.scale for p in task.parameters()])
    values = np.array([0.574, 0.0, 0.046, 0.0, 1.53, 1.0, 0.001, -0.001, 0.002])
    before = estimate(task, values, 0.1)
    start = np.array([0.566, 0.0, 0.0545])
    dynamics = dynamics_of(task.as_believed(values), CELL)
    found = predictions(dynamics, task.parameters(), before, start, start + np.array([0.006, 0.0, 0.0]))
    assert len(found) > 1
    for one in found:
        np.testing.assert_allclose(one.values[5:], values[5:])
        np.testing.assert_allclose(np.sqrt(np.diag(one.covariance))[5:], 0.1 * scale[5:], rtol=0.01)
    assert (np.sqrt(np.diag(found[-1].covariance))[:5] > scale[:5]).all()


def test_what_contact_moves_tells_nothing_of_the_camera() -> None:
    """It lies where the image shows it, less the shift that was believed; untouched it tells as before."""
    task = task_named("spatula_flipping_hard")
    assert isinstance(task, SpatulaFlipping)
    specs = task.parameters()
    scale = np.array([p.scale for p in specs])
    values = np.array([0.512, 0.003, 0.006, 0.0, 0.0, 1.0, 0.001, -0.001, 0.002])
    before = estimate(task, values, 0.1)
    dynamics, along = dynamics_of(task.as_believed(values), CELL), np.array([0.012, 0.0, 0.0])
    start = np.array([0.456, 0.003, task.low])
    (pushed,) = predictions(dynamics, specs, before, start, start + along)
    (beside,) = predictions(dynamics, specs, before, start - 2.5 * along, start - 1.5 * along)
    assert moved_by_contact(before, pushed, specs) and not moved_by_contact(before, beside, specs)
    fit = np.array([0.520, 0.012, 0.007, 0.1, 0.0, 0.98, 0.004, -0.006, 0.001])
    known = 1e-8 * np.eye(9) + np.diag([0, 0, 0, 1e-6, 1e-6, 1e-6, 0, 0, 0])
    kept = camera_kept(before, replace(before, values=fit, covariance=known), specs)
    np.testing.assert_allclose(kept.values[6:], values[6:])
    np.testing.assert_allclose(kept.values[:3] + kept.values[6:], fit[:3] + fit[6:], atol=1e-12)
    np.testing.assert_allclose(kept.values[3:6], fit[3:6])
    np.testing.assert_allclose(np.sqrt(np.diag(kept.covariance))[6:], 0.1 * scale[6:])
    assert np.linalg.eigvalsh(kept.covariance).min() > 0
    shown = np.hstack([np.eye(3), np.zeros((3, 3)), np.eye(3)])
    np.testing.assert_allclose(shown @ kept.covariance @ shown.T, shown @ known @ shown.T, atol=1e-15)


def test_only_a_place_beside_a_camera_s_shift_is_kept_so() -> None:
    """A plain pancake and a thread are corrected as they were."""
    for task in (SpatulaFlipping(), NeedleThreading(), task_named("needle_threading_hard")):
        values = np.array([p.nominal for p in task.parameters()])
        one = estimate(task, values, 0.1)
        assert not moved_by_contact(one, replace(one, values=values + 0.01), task.parameters())


def test_where_nothing_moves_nothing_changes() -> None:
    """A tool at rest, or a block that is screwed to the table."""
    task = PegInsertion()
    before = estimate(task, np.array([0.51, -0.02]), 0.1)
    dynamics, tip = dynamics_of(task, CELL), np.array([0.5, 0.0, 0.1])
    assert predictions(dynamics, task.parameters(), before, tip, tip + 5e-5) == (before,)
    (after,) = predictions(dynamics, task.parameters(), before, tip, tip - np.array([0.0, 0.0, 0.03]))
    np.testing.assert_array_equal(after.values, before.values)
    np.testing.assert_allclose(np.diag(after.covariance), np.diag(before.covariance), rtol=1e-9)


def test_refuses_tips_that_are_none() -> None:
    """Not finite, or not three numbers."""
    task = PegInsertion()
    before = estimate(task, np.array([0.51, -0.02]), 0.1)
    for tip in (np.full(3, np.nan), np.zeros(2)):
        with pytest.raises(InputError, match="finite"):
            predictions(dynamics_of(task, CELL), task.parameters(), before, np.array([0.5, 0.0, 0.1]), tip)
