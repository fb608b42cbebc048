"""Training images of cells that are drawn from what a correction leaves open."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from samrl_core.cell.calibration.cell_correction import CellCorrection, CorrectionCovariance, twist_names
from samrl_core.cell.calibration.seen_error import seen_columns
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.common.errors import InputError
from samrl_core.learning.data.fit import IMAGE
from samrl_core.learning.images.appearance import AppearanceSettings
from samrl_core.learning.images.batch_render import BatchRenderer
from samrl_core.learning.images.cell_errors import CellErrors
from samrl_core.learning.images.image_noise import ImageNoiseSettings
from samrl_core.learning.images.rendered_samples import RenderedSamples, SampleSettings, Scenes
from samrl_core.learning.sim.randomising import Randomising
from samrl_core.learning.sim.sample_states import StateSource, sample_states
from samrl_core.learning.sim.train_settings import TrainSettings
from samrl_core.learning.states.explore import ExploreSettings
from samrl_core.model.model import Model
from samrl_core.policy.view.views import cameras_of

CELL = cell_named()
CPU = torch.device("cpu")
VIEWS = np.array([[0.6, 0.6, 0.35, 0.5, 0.0, 0.08], [-0.9, 0.8, 0.4, 0.52, 0.02, 0.08]])
NAMES = (*twist_names("camera_in_flange"), *twist_names("tool_base_in_camera_base"))
BASES = CELL.camera_base_in_world.inverse() @ CELL.tool_base_in_world
NUMBERS = {"depth_scale": 0.03, "depth_offset": 0.0, "fx": 0.01, "k1": 0.1}


def correction(size: float) -> CellCorrection:
    names = (*NAMES, *NUMBERS)
    factor = size * np.random.default_rng(1).standard_normal((len(names), len(names)))
    known = CorrectionCovariance(names, factor @ factor.T)
    return CellCorrection(CELL.camera_in_flange, BASES, NUMBERS, covariance=known)


def test_points_move_as_the_correction_says() -> None:
    one, rng = correction(1e-3), np.random.default_rng(0)
    errors = CellErrors.draw_cells(one, rng, 2)
    rotation, translation = cameras_of(VIEWS)
    points = VIEWS[:, None, 3:] + 0.05 * rng.standard_normal((2, 6, 3))
    moved = errors.moved(torch.from_numpy(points.reshape(2, 2, 3, 3)), (rotation, translation), CELL)
    for k in range(2):
        turn, way = rotation[k].numpy(), translation[k].numpy()
        camera = type(BASES).from_rotation(-turn.T @ way, turn.T)
        wanted = points[k] + seen_columns(one, CELL, camera, points[k]) @ errors.values[k]
        np.testing.assert_allclose(moved[k].reshape(6, 3).numpy(), wanted, atol=1e-12)
        assert 1e-4 < np.abs(wanted - points[k]).max() < 0.05


def test_cells_are_drawn_from_the_covariance() -> None:
    one = correction(1e-3)
    values = CellErrors.draw_cells(one, np.random.default_rng(0), 5000).values
    wanted = one.covariance.matrix
    scale = np.sqrt(np.outer(np.diag(wanted), np.diag(wanted)))
    np.testing.assert_allclose(np.cov(values.T) / scale, wanted / scale, atol=0.08)


def test_images_differ_in_their_points_alone() -> None:
    model = Model(task_named("peg_insertion"), CELL)
    states = sample_states(
        model, np.random.default_rng(0), 2, StateSource(ExploreSettings(slots=2, longest=4))
    )
    scenes = Scenes(states.frames, states.tip_in_base, {"action": states.action}, VIEWS)
    plain = AppearanceSettings(plain_share=1.0), ImageNoiseSettings(clean_share=1.0, lost=0.0, jump_lost=0.0)
    renderer = BatchRenderer(model)
    with_it, without = (
        RenderedSamples(scenes, renderer, 0, settings).batch(np.arange(2), CPU)[IMAGE]
        for settings in (
            SampleSettings(appearances=plain[0], noise=plain[1], correction=correction(1e-3)),
            SampleSettings(appearances=plain[0], noise=plain[1]),
        )
    )
    torch.testing.assert_close(with_it[:, :3], without[:, :3])
    assert (with_it[:, 3:] - without[:, 3:]).abs().amax(dim=(1, 2, 3)).min() > 0.0


def test_an_actor_that_sees_the_model_gets_none(tmp_path: Path) -> None:
    model = Model(task_named("peg_insertion"), CELL)
    with pytest.raises(InputError, match="never wrong"):
        Randomising(model, TrainSettings(), tmp_path, None, lambda stage, row: None, False, correction(1e-3))
    settings = TrainSettings(randomisation="uniform")
    asked = correction(1e-3)
    made = Randomising(model, settings, tmp_path, None, lambda stage, row: None, False, asked)
    assert made.correction is asked
