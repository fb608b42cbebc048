"""Views: within the region, the same camera as `look_at` gives, and differentiable."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from samrl_core.cell.tasks import TASKS
from samrl_core.cell.types.pose import look_at
from samrl_core.common.errors import InputError
from samrl_core.model.model import world_to_camera
from samrl_core.policy.view.views import ViewSettings, camera_from, cameras_of, sample_views

REGION = TASKS["peg_insertion"].view_region()


def test_views_fill_the_region() -> None:
    views = sample_views(REGION, np.random.default_rng(0), 2000, ViewSettings(look_jitter=0.0))
    for column, bounds in enumerate((REGION.azimuth, REGION.elevation, REGION.distance)):
        span = bounds[1] - bounds[0]
        assert bounds[0] <= views[:, column].min() < bounds[0] + 0.01 * span
        assert bounds[1] - 0.01 * span < views[:, column].max() <= bounds[1]
    np.testing.assert_array_equal(views[:, 3:], np.tile(REGION.target, (2000, 1)))


def test_the_point_looked_at_varies_as_set() -> None:
    views = sample_views(REGION, np.random.default_rng(0), 4000, ViewSettings(look_jitter=0.02))
    np.testing.assert_allclose((views[:, 3:] - REGION.target).std(axis=0), 0.02, rtol=0.05)


def test_cameras_are_those_of_look_at() -> None:
    views = sample_views(REGION, np.random.default_rng(1), 20)
    rotations, translations = cameras_of(views)
    for view, rotation, translation in zip(views, rotations, translations, strict=True):
        azimuth, elevation, distance, *target = view
        outwards = [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
        expected = world_to_camera(
            look_at(np.array(target) + distance * np.array(outwards), np.array(target))
        )
        torch.testing.assert_close(rotation, expected[0], atol=1e-9, rtol=0.0)
        torch.testing.assert_close(translation, expected[1], atol=1e-9, rtol=0.0)


def test_gradients_of_the_camera() -> None:
    inputs = [torch.tensor(v, dtype=torch.float64, requires_grad=True) for v in (0.7, 0.5, 0.4)]
    inputs.append(torch.tensor([0.5, 0.0, 0.1], dtype=torch.float64, requires_grad=True))
    assert torch.autograd.gradcheck(lambda *view: camera_from(*view), inputs)


def test_wrong_views_are_refused() -> None:
    with pytest.raises(InputError, match="last axis must be 6"):
        cameras_of(np.zeros((4, 3)))
    with pytest.raises(InputError, match="look_jitter"):
        ViewSettings(look_jitter=-1.0)
