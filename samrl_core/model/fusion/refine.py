"""Eq. 7 over a fused mesh: vertices and colours follow the gradient of eqs. 4 to 6 in all views at once."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch

from samrl_core.common.errors import InputError
from samrl_core.model.fusion.fuse import FusedMesh
from samrl_core.model.fusion.masked_view import MaskedView, checked_views
from samrl_core.model.fusion.smooth_field import SmoothField
from samrl_core.model.real2sim.emd import MAX_POINTS, earth_movers_distance
from samrl_core.model.real2sim.target_cloud import eroded, target_cloud
from samrl_core.model.rendering.renderer import SUPERSAMPLE, Rendered, Renderer
from samrl_core.model.rendering.topology import Topology

_KEEP_GRADIENT, _KEEP_SQUARE = 0.9, 0.95  # of the running means, per iteration
# Of a cloud. A thin thing loses most of its pixels with the outline's, and what is left by chance in one
# image and not in the other would pull along the thing: then eq. 5 is left out for this view.
_FEWEST_POINTS = 64


@dataclass(frozen=True)
class RefineSettings:
    """Weights of eq. 6 and the steps of eq. 7.

    Raises:
        InputError: a weight or deviation is negative, both weights are 0, or a count is below 1.
    """

    color_weight: float = 1.0  # lambda_1 [-]
    emd_weight: float = 1.0  # lambda_2 [1/m]
    # How wrong the start is, as standard deviations: they scale the prior, and the steps reach three of them.
    vertex_std: float = 3e-4  # a fused mesh's, measured; 0 leaves the shape alone [m]
    color_std: float = 0.05  # 0 leaves the colours alone
    # ASSUMPTION: half the number of patches that move by themselves (200) times the spread of a pixel's error
    # (0.05), by the number of pixels that err by themselves (12 views of 200).
    prior_weight: float = 0.002  # of the mean squared displacement, in standard deviations [-]
    stiffness: float = 10.0  # of the displacements, see `SmoothField` [-]
    iterations: int = 30  # over which the steps fall to 0
    patience: int = 10  # iterations without a lower loss after which it has converged
    supersample: int = SUPERSAMPLE  # samples per pixel and direction
    threads: int = 1

    def __post_init__(self) -> None:
        for name in ("color_weight", "emd_weight", "vertex_std", "color_std", "prior_weight"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) >= 0):
                raise InputError(f"{name} is {getattr(self, name)}, must be finite and at least 0")
        if self.color_weight + self.emd_weight == 0 or self.iterations < 1 or self.patience < 1:
            raise InputError(
                f"weights {self.color_weight} and {self.emd_weight} must not both be 0, {self.iterations} "
                f"iterations and patience {self.patience} must be at least 1"
            )


@dataclass(frozen=True)
class ViewLosses:
    """Means over the views."""

    total: float  # eq. 6 and the prior [-]
    color: float  # eq. 4, mean absolute difference per pixel of the real mask, 0..1
    emd: float  # eq. 5 [m]


@dataclass(frozen=True, eq=False)
class Refined:
    """The mesh of the lowest loss on the way, and the way."""

    mesh: FusedMesh
    before: ViewLosses
    after: ViewLosses
    losses: tuple[float, ...]  # eq. 6 and the prior, of every iteration
    why_stopped: str  # converged | iteration_limit | diverged


class MeshRenderer:
    """Renders meshes of one set of faces from all views' cameras at once, colours as they are."""

    def __init__(
        self, mesh: FusedMesh, views: Sequence[MaskedView], supersample: int = SUPERSAMPLE, threads: int = 1
    ) -> None:
        """Finds the edges.

        Raises:
            InputError: no views, or views through different lenses.
        """
        checked_views(views)
        lenses = {view.camera.intrinsics for view in views}
        if len(lenses) != 1:
            raise InputError(f"views have {len(lenses)} different intrinsics; refine those of one camera")
        count = len(mesh.vertices)
        topology = Topology.build(
            mesh.vertices, mesh.faces, np.ones(count, dtype=np.int32), np.zeros(count, dtype=np.int32)
        )
        self._renderer = Renderer(topology, lenses.pop(), supersample, threads=threads)
        inverse = [view.camera.camera_in_world.inverse() for view in views]
        self._rotation = torch.from_numpy(np.stack([p.rotation for p in inverse]))
        self._translation = torch.from_numpy(np.stack([p.position for p in inverse]))
        self._target = torch.ones(count)

    def __call__(self, vertices: torch.Tensor, color: torch.Tensor) -> Rendered:
        """Images (B, H, W, ...) of vertices (V, 3) in world [m] with colours (V, 3)."""
        return self._renderer(vertices, color, self._target, self._rotation, self._translation)


class _Misfit:
    """Eqs. 4 to 6 between all views and the mesh."""

    def __init__(self, mesh: FusedMesh, views: Sequence[MaskedView], s: RefineSettings) -> None:
        self._settings = s
        self._render = MeshRenderer(mesh, views, s.supersample, s.threads)
        masks = np.stack([view.mask for view in views])
        colors = np.stack([view.color for view in views]) * masks[..., None]
        self._real = torch.from_numpy(colors.astype(np.float32))
        self._pixels = torch.from_numpy(masks.sum(axis=(1, 2)).astype(np.float32))
        clouds = [target_cloud(v.camera.unproject(v.depth), v.mask) for v in views]
        self._clouds = [torch.from_numpy(c) for c in clouds]

    def __call__(self, vertices: torch.Tensor, color: torch.Tensor) -> tuple[torch.Tensor, ViewLosses]:
        """The loss with its graph, and its parts."""
        s = self._settings
        image = self._render(vertices, color)
        # Before a black background a pixel's colour is G_sim x I_sim of eq. 4 already. Multiplied by its
        # share once more, an outline's pixel would count by the share's square, and the mesh would grow.
        apart = (image.color - self._real).abs().mean(dim=-1)
        color_loss = (apart.sum(dim=(1, 2)) / self._pixels).mean()
        emd = self._emd(image) if s.emd_weight > 0 else color_loss.new_zeros(())
        total = s.color_weight * color_loss + s.emd_weight * emd
        return total, ViewLosses(float(total.detach()), float(color_loss.detach()), float(emd.detach()))

    def _emd(self, image: Rendered) -> torch.Tensor:
        distances = []
        masks = image.target.detach().numpy() > 0.5
        for xyz, mask, real in zip(image.xyz, masks, self._clouds, strict=True):
            inner = torch.from_numpy(eroded(mask))
            cloud = xyz[inner].to(torch.float64)
            if min(len(cloud), len(real)) >= _FEWEST_POINTS:
                distances.append(earth_movers_distance(cloud, real, MAX_POINTS))
        return torch.stack(distances).mean() if distances else image.xyz.new_zeros(())


class _Descent:
    """Adam (Kingma and Ba 2015) with one scale for all vertices, and no vertex moved by more than the step.

    A scale for each would turn the noise where the image hardly depends on a vertex into full steps
    (Nicolet, Jacobson and Jakob 2021, section 4.3); theirs is the steepest vertex, which at a thin part is a
    single one, so here it is the root mean square.
    """

    def __init__(self, start: torch.Tensor, std: float, field: SmoothField, iterations: int) -> None:
        self._start, self._std, self._field = start, std, field
        self._u = torch.zeros_like(start, requires_grad=True)
        self._step = 6.0 * std / iterations  # falling to 0, the steps add up to three deviations
        self._gradient_mean, self._square, self._count, self._last = (
            torch.zeros_like(start),
            0.0,
            0,
            iterations,
        )

    def value(self) -> tuple[torch.Tensor, torch.Tensor]:
        """Where it is (V, 3), and the mean squared way to there in deviations, both with their graphs."""
        if self._std == 0.0:
            return self._start, self._start.new_zeros(())
        way = self._field(self._u)
        return self._start + way, (way**2).sum(dim=1).mean() / self._std**2

    def step(self, total: torch.Tensor) -> None:
        """One step against the gradient of the loss."""
        if self._std == 0.0:
            return
        gradient = torch.autograd.grad(total, self._u, retain_graph=True)[0]
        # Slopes of absolute differences do not vanish at their minimum: the steps must.
        share = 1.0 - self._count / self._last
        self._count += 1
        self._gradient_mean = _KEEP_GRADIENT * self._gradient_mean + (1.0 - _KEEP_GRADIENT) * gradient
        square = float((gradient**2).sum(dim=1).mean())
        self._square = _KEEP_SQUARE * self._square + (1.0 - _KEEP_SQUARE) * square
        if self._square > 0.0:
            mean = self._gradient_mean / (1.0 - _KEEP_GRADIENT**self._count)
            way = mean / math.sqrt(self._square / (1.0 - _KEEP_SQUARE**self._count))
            way = way / torch.linalg.vector_norm(way, dim=1, keepdim=True).clamp(min=1.0)
            self._u = (self._u.detach() - share * self._step * way).requires_grad_()


def refine(
    mesh: FusedMesh,
    views: Sequence[MaskedView],
    settings: RefineSettings | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> Refined:
    """Moves vertices and colours against the gradient of the views' loss.

    Args:
        mesh: where to start; what no view saw moves with its neighbours.
        views: masked images with their cameras' poses, of one lens. Nothing but the thing is rendered, so
            other things must not hide it.
        settings: None for the defaults.
        progress: called with the iteration and its loss.

    Raises:
        InputError: no views, or of several lenses.
    """
    s = settings or RefineSettings()
    misfit = _Misfit(mesh, views, s)
    field = SmoothField(mesh.faces, len(mesh.vertices), s.stiffness)
    shift = _Descent(torch.from_numpy(mesh.vertices), s.vertex_std, field, s.iterations)
    tint = _Descent(torch.from_numpy(mesh.color), s.color_std, field, s.iterations)
    losses: list[ViewLosses] = []
    best, best_mesh, why = 0, mesh, "iteration_limit"
    for k in range(s.iterations):
        (moved, far), (color, off) = shift.value(), tint.value()
        color = color.clamp(0.0, 1.0)
        eq6, parts = misfit(moved, color)
        total = eq6 + s.prior_weight * (far + off)
        parts = replace(parts, total=float(total.detach()))
        losses.append(parts)
        if not math.isfinite(parts.total) or parts.total > 2.0 * losses[0].total:
            why = "diverged"
            break
        if parts.total < losses[best].total or k == 0:
            best = k
            best_mesh = replace(
                mesh, vertices=moved.detach().numpy().copy(), color=color.detach().numpy().copy()
            )
        if progress is not None:
            progress(k, parts.total)
        if k - best >= s.patience:
            why = "converged"
            break
        shift.step(total)
        tint.step(total)
    return Refined(best_mesh, losses[0], losses[best], tuple(p.total for p in losses), why)
