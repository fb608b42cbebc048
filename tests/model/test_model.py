"""The model of the peg insertion cell: projection, gradients of the estimate, occlusion, refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks.peg_insertion.task import BODY, PegInsertion
from samrl_core.cell.types.camera import Camera, Intrinsics
from samrl_core.cell.types.pose import look_at
from samrl_core.common.errors import InputError
from samrl_core.model.model import Model, world_to_camera
from samrl_core.model.scene.settings import ModelSettings

CELL = cell_named()
TASK = PegInsertion()
VALUES = (0.515, -0.01)


@pytest.fixture(scope="module")
def model() -> Model:
    return Model(TASK, CELL)


@pytest.fixture(scope="module")
def joints() -> np.ndarray:
    return TASK.start_joints(CELL)["tool_arm"]


def camera() -> Camera:
    return Camera(CELL.intrinsics, TASK.start_camera())


def colors(model: Model) -> torch.Tensor:
    return torch.from_numpy(model.initial_colors())


def values(x: float = VALUES[0], y: float = VALUES[1]) -> torch.Tensor:
    return torch.tensor([x, y], dtype=torch.float64)


def test_block_is_where_the_camera_projects_it(model: Model, joints: np.ndarray) -> None:
    """Image box of the target against the projection of the block's corners, within half a sample."""
    r = model.render(values(), colors(model), camera(), joints)
    body = TASK.scene(CELL).bodies[0]
    corners = TASK.body_poses(np.array(VALUES))[BODY].apply(body.mesh.vertices)
    uv = camera().project(corners)[:, :2]
    rows, columns = np.nonzero(r.target.numpy() > 0)
    assert uv[:, 0].min() == pytest.approx(columns.min(), abs=1.0)
    assert uv[:, 0].max() == pytest.approx(columns.max() + 1, abs=1.0)
    assert uv[:, 1].min() == pytest.approx(rows.min(), abs=1.0)
    assert uv[:, 1].max() == pytest.approx(rows.max() + 1, abs=1.0)


def test_depth_and_xyz_agree_with_the_table(model: Model, joints: np.ndarray) -> None:
    """Table pixels lie at z = 0, the block's top at its height, and depth unprojects to xyz."""
    r = model.render(values(), colors(model), camera(), joints)
    label, xyz = r.label.numpy(), r.xyz.numpy()
    whole = (r.target.numpy() == 0) & (label == 0) & np.isfinite(r.depth.numpy())
    depth = r.depth.numpy().astype(np.float64)
    points = camera().unproject(np.where(np.isfinite(depth), depth, np.nan))
    assert np.median(np.abs(xyz[whole][:, 2])) < 1e-5
    assert np.nanmax(xyz[..., 2][r.target.numpy() > 0.999]) == pytest.approx(TASK.height, abs=1e-4)
    assert np.median(np.linalg.norm(points[whole] - xyz[whole], axis=1)) < 2e-3  # half a pixel of a sample


def test_tip_comes_from_the_joints(model: Model, joints: np.ndarray) -> None:
    tip = model.tip_in_base(joints).position
    assert np.allclose(tip, [TASK.center_x, TASK.center_y, TASK.height + TASK.start_above], atol=1e-4)


def test_colors_start_from_cad_and_reach_the_image(model: Model, joints: np.ndarray) -> None:
    start = colors(model)
    assert model.color_names[-1] == f"{BODY}/top"
    assert len(model.color_names) <= 8
    red = torch.zeros_like(start)
    red[-1, 0] = 1.0
    r = model.render(values(), red, camera(), joints)
    image = r.color.numpy()[r.target.numpy() > 0.999]
    assert set(np.unique(np.round(image[:, 0], 4))) >= {0.0, 1.0}
    assert np.abs(image[:, 1:]).max() < 1e-6


def test_the_tool_hides_the_block(model: Model, joints: np.ndarray) -> None:
    """Seen from behind the tool less of the block is left; only the tool's place differs."""
    above = Camera(CELL.intrinsics, look_at(np.array([0.5, -0.03, 0.60]), np.array([0.5, 0.0, 0.04])))
    hidden = float(model.render(values(0.5, 0.0), colors(model), above, joints).target.sum())
    away = joints + np.array([1.0, 0, 0, 0, 0, 0, 0])
    free = float(model.render(values(0.5, 0.0), colors(model), above, away).target.sum())
    assert hidden < 0.9 * free


@pytest.mark.parametrize("channel", ["color", "xyz", "target"])
def test_gradient_of_the_estimate(channel: str, model: Model, joints: np.ndarray) -> None:
    """By hole position and camera, against central differences of a 16 x 16 supersampled image.

    For the camera the arm is swung aside: its links run through each other, and the curves where they
    do so move with the camera but have no edges (see `renderer`).
    """
    fine = Model(TASK, CELL, ModelSettings(supersample=16))
    aside = joints + np.array([1.0, 0, 0, 0, 0, 0, 0])
    y, x = torch.meshgrid(torch.linspace(-1, 1, 128), torch.linspace(-1, 1, 128), indexing="ij")
    weights = torch.sin(2.1 * x + 1.3 * y + 0.4) + 0.5 * torch.cos(3.0 * y - 1.7 * x)
    rotation, translation = world_to_camera(TASK.start_camera())

    def value(m: Model, v: torch.Tensor, shift: torch.Tensor, arm: np.ndarray) -> torch.Tensor:
        image = getattr(m.render(v, colors(m), (rotation, translation + shift), arm), channel)
        return (image * (weights[..., None] if image.ndim == 3 else weights)).sum()

    v, shift = values().requires_grad_(True), torch.zeros(3, dtype=torch.float64, requires_grad=True)
    (slope_v,) = torch.autograd.grad(value(model, v, shift, joints), v)
    (slope_c,) = torch.autograd.grad(value(model, v, shift, aside), shift)
    with torch.no_grad():
        h = 1e-3
        still = torch.zeros(3, dtype=torch.float64)
        by_v = torch.stack(
            [
                value(fine, values() + e, still, joints) - value(fine, values() - e, still, joints)
                for e in h * torch.eye(2, dtype=torch.float64)
            ]
        )
        by_c = torch.stack(
            [
                value(fine, values(), e, aside) - value(fine, values(), -e, aside)
                for e in h * torch.eye(3, dtype=torch.float64)
            ]
        )
    pairs = ((slope_v, by_v / (2 * h)), (slope_c, by_c / (2 * h)))
    errors = [float((a - b).norm() / b.norm()) for a, b in pairs]
    print(channel, "relative errors: hole", errors[0], "camera", errors[1])
    assert max(errors) < 0.02


def test_forward_follows_the_estimate(model: Model) -> None:
    """Above the estimated hole the peg goes in; 10 mm beside it the block holds it up."""
    down = torch.tensor([[0.0, 0.0, -0.005]], dtype=torch.float64)
    over = np.array([*VALUES, 0.042])

    def height(hole_x: float) -> float:
        state = model.dynamics.start(np.array([hole_x, VALUES[1]]), over)
        return float(model.forward(state, down).q[0, 2])

    assert height(VALUES[0]) == pytest.approx(0.037, abs=1e-6)
    assert height(VALUES[0] + 0.01) > 0.0398
    state = model.dynamics.start(np.array([VALUES[0] + 0.0021, VALUES[1]]), over)
    q = state.q.clone().requires_grad_(True)
    (slope,) = torch.autograd.grad(model.forward(replace(state, q=q), down).q[0, 2], q)
    assert float(slope[0, 3].abs()) > 0  # the hole's x


def test_bad_input_is_refused(model: Model, joints: np.ndarray) -> None:
    c = colors(model)
    with pytest.raises(InputError, match="finite"):
        model.render(values(float("nan")), c, camera(), joints)
    with pytest.raises(InputError, match="declares"):
        model.render(torch.zeros(3), c, camera(), joints)
    with pytest.raises(InputError, match="colors have shape"):
        model.render(values(), c[:-1], camera(), joints)
    with pytest.raises(InputError, match="color has a non-finite"):
        model.render(values(), c * float("nan"), camera(), joints)
    with pytest.raises(InputError, match="finite"):
        model.render(values(), c, camera(), joints * np.nan)
    other = Camera(Intrinsics(64, 64, 60.0, 60.0, 32.0, 32.0), TASK.start_camera())
    with pytest.raises(InputError, match="cell's"):
        model.render(values(), c, other, joints)
    with pytest.raises(InputError, match="one per state"):
        model.forward(model.dynamics.start(np.array(VALUES), np.zeros(3)), torch.zeros(3))
