"""Fit of the target's pose to one image where parameters act together: rotations, joints of a chain.

Eq. 6 is reduced by damped Newton steps: its gradient comes from the renderer and the matched points, its
curvature from how the target's points move. Then a few steps weigh every pixel by its noise, and the
result is the likeliest pose of image and belief together, with its covariance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch

from samrl_core.cell.tasks.task import ParameterSpec, Task
from samrl_core.model.real2sim.damped import DampedSettings, Local, minimize_damped
from samrl_core.model.real2sim.emd import earth_movers
from samrl_core.model.real2sim.group_colors import fit_colors
from samrl_core.model.real2sim.information import (
    ImageNoise,
    ViewInformation,
    newton_step,
    view_information,
    weighted_product,
    widened_belief,
)
from samrl_core.model.real2sim.misfit import Misfit, RealTarget
from samrl_core.model.real2sim.target_cloud import eroded
from samrl_core.model.real2sim.target_renderer import TargetRenderer

_NEAR = 5e-4  # points nearer than this pull no harder [m]


@dataclass(frozen=True)
class PoseFitSettings:
    """Losses, step control and noise."""

    # What a step of the descent counts in: what moves the target's fastest point so far, within limits.
    step_pixels: float = 8.0  # [px]
    step_limits: tuple[float, float] = (1.0, 6.0)  # [parameter's scale]
    coarse_above: float = 0.004  # distance of the clouds above which EMD alone is reduced first [m]
    # A rigid target whose clouds stay this far apart is searched again, turned either way about each axis:
    # past its edge a disc shows its other face, and no gradient leads there.
    lost_above: float = 0.012  # [m]
    turn: float = 0.7  # [rad]
    coarse: DampedSettings = DampedSettings(max_evaluations=10, patience=2)
    fine: DampedSettings = DampedSettings(max_evaluations=10)
    belief_weight: float = 2e-5  # of the distance to what was believed, per parameter and deviation [m]
    polish: int = 6  # noise-weighted Newton steps at the end, at most
    polish_enough: float = 0.4  # converged when one of them is below, in root mean square [std. deviation]
    polish_limit: float = 2.0  # longest of them, in pixels of the target's fastest point [px]
    jacobian_pixels: float = 0.5  # half span of the differences, of the target's fastest point [px]
    # Share of either mask that must lie on the other, give or take a pixel, to call a fit converged.
    least_overlap: float = 0.9
    surprise: float = 9.0  # squared Mahalanobis distance per parameter above which the belief is widened


@dataclass(frozen=True, eq=False)
class PoseFit:
    """The likeliest pose and what is known of it."""

    values: np.ndarray  # (P,)
    covariance: np.ndarray  # (P, P)
    colors: np.ndarray  # (G, 3)
    evaluations: int  # renderings with gradient
    why_stopped: str  # converged | iteration_limit | diverged
    covers: bool = True  # whether its mask and the image's lie on each other


def acts_together(task: Task) -> bool:
    """Whether a task's parameters are more than the three coordinates of a position: rotations or joints."""
    return len(task.parameters()) > 3


class PoseObjective:
    """Eqs. 5 and 6 and the prior's term, each with gradient and curvature."""

    def __init__(
        self,
        renderer: TargetRenderer,
        real: RealTarget,
        misfit: Misfit,
        belief: tuple[np.ndarray, np.ndarray],
        belief_weight: float,
    ) -> None:
        """Belief: mean and standard deviation (P,)."""
        self._renderer = renderer
        self._real = real
        self._misfit = misfit
        self._mean, self._deviation = belief
        self._belief_weight = belief_weight
        # What eq. 4 grows by per pixel of motion across the boundary.
        mask = real.image.mask
        rim = np.abs(np.diff(mask.astype(np.int8), axis=0)).sum() + np.abs(np.diff(mask, axis=1)).sum()
        brightness = float(real.image.color[mask].mean()) if mask.any() else 0.0
        self._edge_gradient = brightness * float(rim) / max(real.pixels, 1)

    def coarse(self, values: np.ndarray, colors: np.ndarray) -> Local:
        """Eq. 5 [m]."""
        with torch.no_grad():
            r = self._renderer.render(torch.as_tensor(values), torch.as_tensor(colors))
        return self._pull(values, r)[0].plus(self._belief(values), self._belief_weight)

    def fine(self, values: np.ndarray, colors: np.ndarray) -> Local:
        """Eq. 6."""
        variable = torch.tensor(values, requires_grad=True)
        r = self._renderer.render(variable, torch.as_tensor(colors))
        loss = self._misfit.color_loss(r)
        (gradient,) = torch.autograd.grad(loss, variable)
        pull, pixel_motion = self._pull(values, r)
        # |d| has the curvature 1 / |d| at a distance d (iterated least squares); a pixel stands for it here.
        edges = self._edge_gradient * np.einsum("ncp,ncq->pq", pixel_motion, pixel_motion) / len(pixel_motion)
        color = Local(loss.item(), gradient.numpy(), edges)
        m = self._misfit
        total = Local(0.0, np.zeros_like(values), np.zeros((values.size, values.size)))
        total = total.plus(color, m.color_weight).plus(pull, m.emd_weight)
        return total.plus(self._belief(values), self._belief_weight)

    def _pull(self, values: np.ndarray, rendered) -> tuple[Local, np.ndarray]:
        """Eq. 5, and how the matched points move in the image (M, 2, P) [px]."""
        cloud = self._renderer.cloud(rendered)
        if len(cloud) < 8:  # out of sight in the model: pull with the whole target instead
            cloud = self._renderer.whole_surface(values)
        compared = self._renderer.compared_points(cloud)
        moved = earth_movers(compared, self._real.cloud, self._misfit.points(cloud))
        used, wanted = moved.matched.T
        motion = self._renderer.compared_motion(self._renderer.motion(values, cloud[used]))
        distance = np.linalg.norm(compared[used] - self._real.cloud[wanted], axis=1)
        weight = 1.0 / np.maximum(distance, _NEAR) / len(used)
        gradient = np.einsum("nc,ncp->p", moved.gradient[used], motion)
        curvature = weighted_product(motion, weight, motion)
        return Local(moved.value, gradient, curvature), self._renderer.pixel_motion(cloud[used], motion)

    def _belief(self, values: np.ndarray) -> Local:
        """Distance from the belief's mean in its deviations, quadratic near it and linear far away."""
        d = (values - self._mean) / self._deviation
        root = np.sqrt(1.0 + d * d)
        return Local(
            float((root - 1.0).sum()), d / root / self._deviation, np.diag(1.0 / root / self._deviation**2)
        )


def fit_pose(
    renderer: TargetRenderer,
    real: RealTarget,
    misfit: Misfit,
    start: np.ndarray,
    colors: np.ndarray,
    belief: np.ndarray,
    noise: ImageNoise,
    settings: PoseFitSettings,
    watch: Callable[[np.ndarray], None] | None = None,
) -> PoseFit:
    """The pose that image and belief make likeliest.

    Args:
        renderer: of the image's camera and joints.
        real: the target in the image.
        misfit: eqs. 4 to 6 of the two.
        start: mean of the belief (P,).
        colors: of all surface groups (G, 3).
        belief: covariance of the belief (P, P).
        noise: of the image.
        settings: see there.
        watch: called with the best values after each rendering with gradient, and after each step at the end.
    """
    s, scale, lower, upper = settings, *_bounds(renderer)
    descent = descend(renderer, real, misfit, start, colors, belief, s, watch)
    values, colors, evaluations = descent.values, descent.colors, descent.evaluations
    if descent.why_stopped == "diverged":
        return descent

    def view_at(at: np.ndarray) -> ViewInformation:
        return pose_information(renderer, at, colors, noise, s)

    view = view_at(values)
    widened = widened_belief(start, belief, values, view.matrix, s.surprise)
    precision = np.linalg.inv(widened)
    covariance = np.linalg.inv(precision + view.matrix)
    why = descent.why_stopped
    for k in range(s.polish):
        if k:
            view = view_at(values)
        covariance = np.linalg.inv(precision + view.matrix)
        change = newton_step(view, real.image, belief=(start - values, precision))
        squared = float(change @ np.linalg.solve(covariance, change)) / change.size  # of the whole step
        limit = np.minimum(renderer.pixel_steps(values, s.polish_limit), scale)
        change = change / max(1.0, float(np.abs(change / limit).max()))
        values = np.clip(values + change, lower, upper)
        if watch is not None:
            watch(values)
        small = squared < s.polish_enough**2
        why = "converged" if small else "iteration_limit"
        if small:
            break
    covers = overlap(renderer.image(values, colors).mask, real.image.mask) >= s.least_overlap
    if not covers:
        why, covariance = "iteration_limit", belief  # it may stand still, but elsewhere: nothing is learnt
    return PoseFit(values, 0.5 * (covariance + covariance.T), colors, evaluations, why, covers)


def descend(
    renderer: TargetRenderer,
    real: RealTarget,
    misfit: Misfit,
    start: np.ndarray,
    colors: np.ndarray,
    belief: np.ndarray,
    settings: PoseFitSettings,
    watch: Callable[[np.ndarray], None] | None = None,
) -> PoseFit:
    """The least of eq. 6 near a belief, and colours for it; its covariance is the belief's.

    Arguments as of `fit_pose`.
    """
    s, scale, lower, upper = settings, *_bounds(renderer)
    specs = renderer.specs
    deviation = np.sqrt(np.diag(belief))
    objective = PoseObjective(renderer, real, misfit, (start, deviation), s.belief_weight)
    low, high = s.step_limits
    unit = np.clip(renderer.pixel_steps(start, s.step_pixels), low * scale, high * scale)
    values, evaluations = start, 0
    if misfit.losses(start, colors).emd > s.coarse_above:
        coarse = minimize_damped(
            lambda v: objective.coarse(v, colors), start, unit, lower, upper, s.coarse, watch
        )
        values, evaluations = coarse.parameters, coarse.evaluations
        turns = _turns(specs, s.turn) if coarse.value > s.lost_above and not renderer.thin else ()
        for turn in turns:
            other = minimize_damped(
                lambda v: objective.coarse(v, colors), start + turn, unit, lower, upper, s.coarse
            )
            evaluations += other.evaluations
            if other.value < coarse.value:
                coarse, values = other, other.parameters
    colors = fit_colors(renderer, real, values, colors)
    fit = minimize_damped(lambda v: objective.fine(v, colors), values, unit, lower, upper, s.fine, watch)
    evaluations += fit.evaluations
    if fit.why_stopped == "diverged":
        return PoseFit(start, belief, colors, evaluations, "diverged")
    values = fit.parameters
    colors = fit_colors(renderer, real, values, colors)
    return PoseFit(values, belief, colors, evaluations, fit.why_stopped)


def pose_information(
    renderer: TargetRenderer,
    values: np.ndarray,
    colors: np.ndarray,
    noise: ImageNoise,
    settings: PoseFitSettings,
) -> ViewInformation:
    """What an image says near values (Q,), by steps of so many pixels of the fastest point."""
    scale, _, _ = _bounds(renderer)
    return view_information(
        lambda v: renderer.image(v, colors),
        values,
        np.minimum(renderer.pixel_steps(values, settings.jacobian_pixels), scale),
        noise,
        render_all=lambda many: renderer.images(many, colors),
    )


def _bounds(renderer: TargetRenderer) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Scales and bounds (Q,) of the renderer's values."""
    scale, lower, upper = np.array([(p.scale, p.lower, p.upper) for p in renderer.specs]).reshape(-1, 3).T
    return scale, lower, upper


def overlap(a: np.ndarray, b: np.ndarray) -> float:
    """Share of the mask (H, W) that lies within a pixel of the other, the smaller one of the two ways."""
    if not (a.any() and b.any()):
        return 0.0
    return min(float((~eroded(~one))[other].mean()) for one, other in ((a, b), (b, a)))


def _turns(specs: tuple[ParameterSpec, ...], angle: float) -> list[np.ndarray]:
    """Changes of the parameters (P,): each angle by `angle` [rad] up and down."""
    which = [k for k, spec in enumerate(specs) if spec.unit == "rad"]
    return [sign * angle * np.eye(len(specs))[k] for k in which for sign in (1.0, -1.0)]
