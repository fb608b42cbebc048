"""The part of the image that shows the target: the same pixels as in the whole image, and all of them."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import TASKS, task_named
from samrl_core.cell.types.camera import Camera
from samrl_core.cell.types.pose import look_at
from samrl_core.model.model import Model
from samrl_core.model.rendering.window import Window, whole_image, window_around
from samrl_core.model.scene.settings import ModelSettings

CELL = cell_named()
K = CELL.intrinsics


@pytest.mark.parametrize("name", TASKS)
def test_the_window_has_the_pixels_of_the_whole_image(name: str) -> None:
    """But for a sample at most in a few pixels, where an edge goes through it by the last digit."""
    task = task_named(name)
    model = Model(task, CELL, ModelSettings(threads=1))
    colors, joints = torch.from_numpy(model.initial_colors()), task.start_joints(CELL)["tool_arm"]
    rng = np.random.default_rng(4)
    region = task.view_region()
    for _ in range(4):
        values = torch.from_numpy(np.stack([task.start_values(rng) for _ in range(3)]))
        eye = task.start_camera().position + rng.uniform(-0.05, 0.05, 3)
        camera = Camera(K, look_at(eye, region.target))
        whole = model.render(values, colors, camera, joints)
        part, window = model.render_target(values, colors, camera, joints)
        assert part.target.shape[1] * part.target.shape[2] < 0.5 * K.width * K.height
        outside = whole.target.clone()
        outside[:, window.rows, window.columns] = 0.0
        assert float(whole.target.sum()) > 10.0 and float(outside.abs().max()) == 0.0
        for field in ("color", "xyz", "target", "label"):
            expected = getattr(whole, field)[:, window.rows, window.columns]
            differs = (getattr(part, field) - expected).abs() > 1e-5
            assert float(differs.double().mean()) < 2e-3, field


def test_a_window_lies_within_the_image_and_around_the_points() -> None:
    points = np.array([[0.01, -0.02, 0.5], [-0.03, 0.0, 0.4]])
    u, v = K.fx * points[:, 0] / points[:, 2] + K.cx, K.fy * points[:, 1] / points[:, 2] + K.cy
    found = window_around(points, K, 0.02, margin=3)
    assert found.left == np.floor(u.min()) - 3 and found.right == np.ceil(u.max()) + 4
    assert found.top == np.floor(v.min()) - 3 and found.bottom == np.ceil(v.max()) + 4
    wide = np.concatenate([points, [[5.0, 5.0, 1.0], [-5.0, -5.0, 1.0]]])
    assert window_around(wide, K, 0.02) == whole_image(K)


@pytest.mark.parametrize("points", [[[0.0, 0.0, 0.01]], [[0.0, 0.0, -1.0]], [[9.0, 0.0, 1.0]], []])
def test_what_has_no_window_is_drawn_whole(points: list) -> None:
    """Before the near plane, behind the camera, beside the image, and nothing at all."""
    assert window_around(np.array(points).reshape(-1, 3), K, 0.02) == whole_image(K)


def test_a_part_is_pasted_where_it_was() -> None:
    part = np.arange(12.0).reshape(2, 2, 3) + 1
    whole = Window(1, 2, 4, 4).pasted(part, 5, 6)
    assert whole.shape == (2, 5, 6) and whole.sum() == part.sum()
    np.testing.assert_array_equal(whole[:, 2:4, 1:4], part)
