"""What views would tell: a still camera shows hand-eye and base as one, the same view again adds little."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.diagnosis.residuals.images.expected import (
    ViewInformation,
    expected_rows,
    expected_scene,
    smallest_angle,
    still_recording,
)

TASK = "peg_insertion"
HAND_EYE, BASE, BASE_LIKE = ({"hand_eye": 1.0},), ({"base": 1.0},), ({"base": -2.0},)


@pytest.fixture(scope="module")
def start() -> dict[str, np.ndarray]:
    return task_named(TASK).start_joints(cell_named(DEFAULT_CELL))


def test_one_view_shows_hand_eye_and_base_as_one(start: dict[str, np.ndarray]) -> None:
    still = still_recording(TASK, DEFAULT_CELL, start)
    scene = expected_scene(still)
    turned = start["camera_arm"] + np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.8])
    raised = start["camera_arm"] + np.array([0.0, 0.05, 0.0, 0.1, 0.0, 0.05, -0.6])
    others = [replace(still, camera_joints=np.stack([q, q])) for q in (turned, raised)]
    one, *more = (expected_rows(scene, r, 0.5) for r in (still, *others))
    alone, together = (smallest_angle(frames, HAND_EYE, BASE) for frames in ([one], [one, *more]))
    assert alone < 0.01
    assert together > 10.0 * alone and together > 0.1
    assert smallest_angle([one, *more], BASE, BASE_LIKE) < 1e-3
    # Nothing moves: a late image shows nothing.
    assert np.isnan(smallest_angle([one], ({"camera_late": 1.0},), BASE))


def test_the_same_view_again_adds_less_than_another(start: dict[str, np.ndarray]) -> None:
    worth = ViewInformation(TASK, DEFAULT_CELL, start)
    turned = {**start, "camera_arm": start["camera_arm"] + np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.8])}
    assert worth.nat == 0.0
    first, before = worth.gain(start), worth.deviations("hand_eye")
    worth.take(start)
    assert worth.nat == pytest.approx(first)
    assert 0.0 < worth.gain(start) < worth.gain(turned) < first
    assert (worth.deviations("hand_eye") < before).all()


def test_gradients_of_one_rendering_are_those_of_one_for_each_sum(start: dict[str, np.ndarray]) -> None:
    """To the bit: what is shared is work, not rounding."""
    still = still_recording(TASK, DEFAULT_CELL, start)
    scene = expected_scene(still)
    vertices = scene.vertices(scene.view(still, 0.5), np.eye(4))
    k, rng = scene.intrinsics, np.random.default_rng(0)
    weights = rng.standard_normal((5, k.height, k.width, 3)).astype(np.float32)
    weights[1:] *= rng.random((4, k.height, k.width, 1)) < 0.05
    batch = torch.from_numpy(np.broadcast_to(vertices, (5, *vertices.shape)).copy()).requires_grad_(True)
    (scene._render(batch, scene._shares).color * torch.from_numpy(weights)).sum().backward()
    assert batch.grad is not None and bool((batch.grad != 0.0).any())
    np.testing.assert_array_equal(scene.gradients(vertices, weights), batch.grad.numpy())
