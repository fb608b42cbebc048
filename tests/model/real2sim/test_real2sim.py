"""Real2Sim on PyBullet's images: accuracy, honesty of the covariance, fusion, and what it refuses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.observation import Observation
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.common.errors import InputError
from samrl_core.model.model import Model
from samrl_core.model.real2sim.misfit import Losses, Misfit, RealTarget
from samrl_core.model.real2sim.real2sim import Estimate, Real2Sim, initial_estimate
from samrl_core.model.real2sim.target_renderer import TargetRenderer
from samrl_core.studies.episodes.cell_driver import CellDriver

BOARD = "hole_board"


def observe(driver: CellDriver, seed: int) -> Observation:
    """The start view of a seed."""
    driver.world.reset(seed)
    return driver.observe()


def error(driver: CellDriver, estimate: Estimate) -> np.ndarray:
    """Against the truth, which only a test or an evaluation may read (2,) [m]."""
    return estimate.values - driver.world.truth().body_position[BOARD][:2]


def test_one_view_from_the_centre_of_the_range(model: Model, driver: CellDriver) -> None:
    """One seed: within a millimetre, losses down, colours fitted, covariance shrunk."""
    before = initial_estimate(model)
    after = Real2Sim(model).update(before, observe(driver, 0))
    assert np.linalg.norm(error(driver, after)) < 1e-3
    assert after.converged and after.why_stopped == "converged"
    assert after.loss_after < 0.3 * after.loss_before
    assert after.color_loss_after < after.color_loss_before and after.emd_after < after.emd_before
    assert np.linalg.eigvalsh(after.covariance).max() < 1e-6 < np.linalg.eigvalsh(before.covariance).min()
    top = after.color_names.index("hole_board/top")
    assert np.abs(after.colors[top] - before.colors[top]).max() > 0.02
    assert (after.color_variance[top] < before.color_variance[top]).all()


def test_second_image_is_quicker_and_not_worse_off(model: Model, driver: CellDriver) -> None:
    """A warm update needs fewer renderings and leaves a smaller covariance."""
    real2sim = Real2Sim(model)
    first = real2sim.update(initial_estimate(model), observe(driver, 3))
    second = real2sim.update(first, driver.observe())
    assert second.iterations < first.iterations
    assert np.trace(second.covariance) < np.trace(first.covariance)
    assert np.linalg.norm(error(driver, second)) < 1e-3


def test_same_input_same_bits(model: Model, driver: CellDriver) -> None:
    """A replay must give the same estimate."""
    image = observe(driver, 4)
    runs = [Real2Sim(model).update(initial_estimate(model), image) for _ in range(2)]
    np.testing.assert_array_equal(runs[0].values, runs[1].values)
    np.testing.assert_array_equal(runs[0].covariance, runs[1].covariance)


def test_target_absent_changes_nothing(model: Model, driver: CellDriver) -> None:
    """No target pixel: values, covariance and colours stay, and the reason is given."""
    image = observe(driver, 1)
    empty = replace(image.frame, mask=np.where(image.frame.mask == 1, 0, image.frame.mask).astype(np.uint8))
    before = initial_estimate(model)
    after = Real2Sim(model).update(before, replace(image, frame=empty))
    assert (after.why_stopped, after.converged, after.iterations) == ("no_target", False, 0)
    np.testing.assert_array_equal(after.values, before.values)
    np.testing.assert_array_equal(after.covariance, before.covariance)
    assert after.stamp_ns == image.stamp_ns


def test_a_fit_that_breaks_teaches_nothing(
    model: Model, driver: CellDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A loss that is no number: "diverged", and values, colours and what is known of both as before."""

    def broken(self: Misfit, parameters: np.ndarray) -> tuple[float, np.ndarray]:
        return float("nan"), np.zeros_like(parameters)

    monkeypatch.setattr(Misfit, "fine", broken)
    before = initial_estimate(model)
    after = Real2Sim(model).update(before, observe(driver, 1))
    assert (after.why_stopped, after.converged) == ("diverged", False)
    for name in ("values", "covariance", "colors", "color_variance"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))
    assert after.loss_after == after.loss_before


@pytest.mark.parametrize(
    ("emd", "color", "farther"),
    [(1e-3, 0.0, False), (0.0, 0.1, False), (1e-3, 0.1, True), (0.0, 0.0, False)],
)
def test_a_belief_that_was_exact_can_be_left(emd: float, color: float, farther: bool) -> None:
    """Points and colours that lay on the image's before have no ratio to those after."""
    assert Losses(color + emd, color, emd).farther_than(Losses(0.0, 0.0, 0.0), 1.3) is farther


def test_a_quarter_of_the_target_lost(model: Model, driver: CellDriver) -> None:
    """A big hole in mask and depth moves the estimate by less than a millimetre."""
    image = observe(driver, 2)
    rows, columns = np.nonzero(image.frame.mask == 1)
    v, u = np.mgrid[0 : image.frame.mask.shape[0], 0 : image.frame.mask.shape[1]]
    corner = (v > rows.mean()) & (u > columns.mean()) & (image.frame.mask == 1)
    mask = np.where(corner, 0, image.frame.mask).astype(np.uint8)
    depth = np.where(corner, np.nan, image.frame.depth).astype(np.float32)
    after = Real2Sim(model).update(
        initial_estimate(model), replace(image, frame=replace(image.frame, mask=mask, depth=depth))
    )
    assert np.linalg.norm(error(driver, after)) < 2e-3


def test_wrong_and_overconfident_belief_is_overruled(model: Model, driver: CellDriver) -> None:
    """Somebody moved the block by 3 cm: one image is enough to follow."""
    image = observe(driver, 5)
    real2sim = Real2Sim(model)
    right = real2sim.update(initial_estimate(model), image)
    wrong = replace(right, values=np.clip(right.values + [0.03, -0.03], [0.45, -0.05], [0.55, 0.05]))
    after = real2sim.update(wrong, image)
    assert np.linalg.norm(error(driver, after)) < 2e-3


def test_not_finite_images_are_refused(driver: CellDriver) -> None:
    """An image without any depth is no observation."""
    image = observe(driver, 6)
    with pytest.raises(InputError, match="depth"):
        replace(image, frame=replace(image.frame, depth=np.full_like(image.frame.depth, np.nan)))


def test_gradient_of_the_loss(model: Model, driver: CellDriver) -> None:
    """Eq. 6's slope by values against differences of eq. 4 over a millimetre, far from the minimum."""
    image = observe(driver, 7)
    renderer = TargetRenderer(model, image.camera, image.tool_arm.position)
    misfit = Misfit(renderer, RealTarget.of(image, renderer.label), 1.0, 0.0)
    colors = model.initial_colors()
    values = driver.world.truth().body_position[BOARD][:2] + [0.012, -0.009]
    _, gradient = misfit.fine(np.concatenate([values, colors.ravel()]))
    for k in range(2):
        h = np.eye(2)[k] * 1e-3
        ends = [misfit.losses(values + s * h, colors).color for s in (1, -1)]
        assert gradient[k] == pytest.approx((ends[0] - ends[1]) / 2e-3, rel=0.15, abs=0.1)


def test_cloud_moves_with_the_body(model: Model, driver: CellDriver) -> None:
    """Eq. 5's slope points home from 3 cm away."""
    image = observe(driver, 8)
    renderer = TargetRenderer(model, image.camera, image.tool_arm.position)
    misfit = Misfit(renderer, RealTarget.of(image, renderer.label), 1.0, 1.0)
    truth = driver.world.truth().body_position[BOARD][:2]
    away = np.clip(truth + [0.03, 0.03], [0.45, -0.05], [0.55, 0.05])
    value, slope = misfit.coarse(away)
    assert value == pytest.approx(np.linalg.norm(away - truth), rel=0.4)
    assert slope @ (away - truth) > 0.5 * np.linalg.norm(slope) * np.linalg.norm(away - truth)


def test_a_screen_keeps_its_colours() -> None:
    """It covers the block in part. Three scenes from the start view: only the block is painted."""
    model = Model(task_named("peg_insertion_occluded"), cell_named())
    world = PyBulletWorld(model.task, model.cell)
    behind, real2sim = CellDriver(world, model.cell, world.scene.tool), Real2Sim(model)
    before = found = initial_estimate(model)
    for seed in range(3):
        world.reset(seed)
        found = real2sim.update(replace(before, values=found.values), behind.observe())
        screens = np.array([name.startswith("screen") for name in found.color_names])
        assert screens.sum() == 42
        np.testing.assert_array_equal(found.colors[screens], before.colors[screens])
        np.testing.assert_array_equal(found.color_variance[screens], before.color_variance[screens])
        assert np.abs(found.colors[~screens] - before.colors[~screens]).max() > 0.02
        assert np.linalg.norm(error(behind, found)) < 1e-3
    world.close()


@pytest.mark.slow
def test_accuracy_and_claimed_accuracy_over_seeds(model: Model, driver: CellDriver) -> None:
    """Twelve seeds: median below half a millimetre, and errors as large as the covariance says."""
    errors, surprise = [], []
    for seed in range(100, 112):
        estimate = Real2Sim(model).update(initial_estimate(model), observe(driver, seed))
        e = error(driver, estimate)
        errors.append(np.linalg.norm(e))
        surprise.append(float(e @ np.linalg.solve(estimate.covariance, e)) / 2)
    assert np.median(errors) < 5e-4 and max(errors) < 1.5e-3
    assert 0.1 < np.mean(surprise) < 3.0  # 1 when the covariance is exact
