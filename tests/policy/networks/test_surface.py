"""Points of what is nearest in each pixel: on the surfaces, also of what is thinner than two pixels."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.tasks.chain import chain_points, link_poses
from samrl_core.model.model import Model
from samrl_core.policy.networks.surface import nearest_points
from samrl_core.policy.view.views import camera_from

RADIUS = 0.002  # of the thread [m]


def thread() -> tuple[Model, np.ndarray, torch.Tensor, torch.Tensor]:
    model = Model(task_named("needle_threading"), cell_named())
    values = model.task.start_values(np.random.default_rng(4))
    target = torch.from_numpy(np.asarray(model.task.view_region().target))
    return model, values, torch.from_numpy(model.initial_colors()), target


@pytest.mark.thorough
def test_points_of_a_thread_lie_on_it() -> None:
    """The mean over a pixel mixes the thread and what is centimetres behind it."""
    model, values, colors, target = thread()
    camera = camera_from(*torch.tensor([0.4, 0.6, 0.4], dtype=torch.float64), target)
    joints = model.task.start_joints(model.cell)["tool_arm"]
    with torch.no_grad():
        rendered = model.render(torch.from_numpy(values), colors, camera, joints)
    line = _line(model, values, joints)
    on_it = rendered.target.numpy() > 0.0
    near = nearest_points(rendered, camera, model.cell.intrinsics).numpy()
    seen = on_it & (_distance(near, line) < 0.02)  # the nearest sample is the thread's
    assert seen.sum() > 20
    assert _distance(near, line)[seen].max() < RADIUS + 0.0025  # a pixel is 2.5 mm wide
    mixed = _distance(rendered.xyz.numpy(), line)[seen]
    assert (mixed > 0.01).mean() > 0.2, "the mean's points lie beside the thread in many pixels"


def _line(model: Model, values: np.ndarray, joints: np.ndarray) -> np.ndarray:
    """Points (N, 3) along the thread's centre line in world [m]."""
    tool = model.task.scene(model.cell).tool
    tip = model.cell.tool_base_in_world @ model.tip_in_base(joints)
    ends = chain_points(tool.chain, link_poses(tool.chain, tip, model.task.chain_angles(values)))
    share = np.linspace(0.0, 1.0, 50)[:, None, None]
    return ((1.0 - share) * ends[:-1] + share * ends[1:]).reshape(-1, 3)


def _distance(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    return np.linalg.norm(points[..., None, :] - line, axis=-1).min(axis=-1)
