"""Eq. 7 pulls vertices and colours of a mesh towards what its pictures show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from samrl_core.cell.types.camera import Camera, Intrinsics
from samrl_core.common.errors import InputError
from samrl_core.model.fusion.fuse import FusedMesh, FusionSettings, fuse
from samrl_core.model.fusion.masked_view import MaskedView
from samrl_core.model.fusion.refine import MeshRenderer, RefineSettings, refine
from samrl_core.model.fusion.smooth_field import SmoothField, laplacian
from tests.model.fusion.ball import CENTER, RADIUS, K, cameras, photos

STEPS = RefineSettings(iterations=12, vertex_std=2e-3, supersample=1)


@pytest.fixture(scope="module")
def views() -> list[MaskedView]:
    return photos(6)


@pytest.fixture(scope="module")
def ball(views: list[MaskedView]) -> FusedMesh:
    return fuse(views, FusionSettings(voxel_size=0.004, truncation=0.01))


def offset(mesh: FusedMesh) -> np.ndarray:
    """Of the seen vertices from the sphere, positive outside [m]."""
    return np.linalg.norm(mesh.vertices[mesh.observed] - CENTER, axis=1) - RADIUS


@pytest.mark.thorough
def test_a_ball_too_large_shrinks(ball: FusedMesh, views: list[MaskedView]) -> None:
    large = replace(ball, vertices=CENTER + 1.08 * (ball.vertices - CENTER))
    result = refine(large, views, STEPS)
    assert np.abs(offset(large)).mean() > 2.5e-3
    assert np.abs(offset(result.mesh)).mean() < 1.5e-3
    assert result.after.total < 0.6 * result.before.total


@pytest.mark.thorough
def test_wrong_colors_are_mended_and_the_shape_left_alone(ball: FusedMesh, views: list[MaskedView]) -> None:
    dark = replace(ball, color=np.maximum(ball.color - 0.1, 0.0))
    shapeless = replace(STEPS, vertex_std=0.0, color_std=0.1)
    result = refine(dark, views, shapeless)
    assert np.array_equal(result.mesh.vertices, ball.vertices)
    before, after = (np.abs(m.color - ball.color)[ball.observed].mean() for m in (dark, result.mesh))
    assert before > 0.08 and after < 0.03


def test_the_mesh_returned_is_that_of_the_lowest_loss(ball: FusedMesh, views: list[MaskedView]) -> None:
    gentle = replace(STEPS, iterations=4, vertex_std=1e-4, color_std=0.005)
    observed: list[float] = []
    result = refine(ball, views[:2], gentle, lambda _, loss: observed.append(loss))
    assert tuple(observed) == result.losses
    assert result.after.total == min(result.losses) <= result.before.total == result.losses[0]
    assert result.why_stopped == "iteration_limit"


def test_it_says_why_it_stopped(ball: FusedMesh, views: list[MaskedView]) -> None:
    still = replace(STEPS, vertex_std=0.0, color_std=0.0, iterations=9, patience=3)
    assert refine(ball, views[:1], still).why_stopped == "converged"
    wild = replace(STEPS, vertex_std=0.05, prior_weight=0.0, iterations=9)
    result = refine(ball, views[:1], wild)
    assert result.why_stopped == "diverged"
    assert np.isfinite(result.mesh.vertices).all() and result.after.total <= result.before.total


def test_the_render_shows_the_ball_where_the_picture_does(ball: FusedMesh, views: list[MaskedView]) -> None:
    image = MeshRenderer(ball, views)(torch.from_numpy(ball.vertices), torch.from_numpy(ball.color))
    for drawn, view in zip(image.target.numpy() > 0.5, views, strict=True):
        assert (drawn & view.mask).sum() > 0.9 * (drawn | view.mask).sum()


def test_no_views_or_two_lenses(ball: FusedMesh, views: list[MaskedView]) -> None:
    with pytest.raises(InputError, match="no views"):
        refine(ball, [])
    half = Intrinsics(K.width, K.height, 0.5 * K.fx, 0.5 * K.fy, K.cx, K.cy)
    other = replace(views[0], camera=Camera(half, cameras(1)[0].camera_in_world))
    with pytest.raises(InputError, match="2 different intrinsics"):
        refine(ball, [views[0], other])


@pytest.mark.parametrize(
    "bad", [{"vertex_std": -1.0}, {"emd_weight": float("nan")}, {"iterations": 0}, {"patience": 0}]
)
def test_bad_settings(bad: dict[str, float]) -> None:
    with pytest.raises(InputError, match="must"):
        RefineSettings(**bad)
    with pytest.raises(InputError, match="must not both be 0"):
        RefineSettings(color_weight=0.0, emd_weight=0.0)


def test_laplacian_is_that_of_the_edges() -> None:
    two = np.array([[0, 1, 2], [1, 3, 2]])
    expected = [[2, -1, -1, 0], [-1, 3, -1, -1], [-1, -1, 3, -1], [0, -1, -1, 2]]
    assert np.array_equal(laplacian(two, 4).toarray(), expected)


def test_the_field_keeps_a_shift_spreads_a_bump_and_has_its_gradient(ball: FusedMesh) -> None:
    count = len(ball.vertices)
    field = SmoothField(ball.faces, count, 20.0)
    shift = torch.tensor([[1.0, -2.0, 3.0]], dtype=torch.float64).expand(count, 3)
    assert torch.allclose(field(shift), shift)
    bump = torch.zeros((count, 3), dtype=torch.float64)
    bump[5, 0] = 1.0
    spread = field(bump)[:, 0]
    assert int(spread.argmax()) == 5 and float(spread.max()) < 0.1
    assert float(spread.sum()) == pytest.approx(1.0)
    few = SmoothField(np.array([[0, 1, 2], [1, 3, 2]]), 4, 0.7)
    u = torch.randn((4, 3), dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    assert torch.autograd.gradcheck(few, (u.requires_grad_(),))
    with pytest.raises(InputError, match="stiffness"):
        SmoothField(ball.faces, count, -1.0)
