"""Real2Sim: correct the model's poses and colours from one RGB-D image (eqs. 4-7)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from samrl_core.cell.types.observation import Observation
from samrl_core.model.model import Model
from samrl_core.model.real2sim.group_colors import fused_colors
from samrl_core.model.real2sim.information import (
    ImageNoise,
    ViewInformation,
    fused,
    newton_step,
    view_information,
)
from samrl_core.model.real2sim.minimize import MinimizeSettings, Minimum, minimize
from samrl_core.model.real2sim.misfit import Losses, Misfit, RealTarget
from samrl_core.model.real2sim.part_fit import PartFit, PartSettings, seen_parts
from samrl_core.model.real2sim.pose_fit import PoseFit, PoseFitSettings, acts_together, fit_pose
from samrl_core.model.real2sim.target_renderer import TargetRenderer


@dataclass(frozen=True, eq=False)
class Estimate:
    """What the model believes, and what the last update did to it."""

    names: tuple[str, ...]  # parameters, P of them
    values: np.ndarray  # (P,) in their units
    covariance: np.ndarray  # (P, P)
    color_names: tuple[str, ...]  # surface groups, G of them; colours of those of the target are fitted
    colors: np.ndarray  # (G, 3) of the model's surface groups, linear RGB 0..1
    color_variance: np.ndarray  # (G, 3)
    stamp_ns: int  # of the image used last, 0 before the first [ns]
    loss_before: float  # eq. 6 [-]
    loss_after: float  # eq. 6 [-]
    color_loss_before: float  # eq. 4, mean absolute difference per mask pixel, 0..1
    color_loss_after: float
    emd_before: float  # eq. 5 [m]
    emd_after: float  # eq. 5 [m]
    iterations: int  # renderings with gradient
    why_stopped: str  # converged | iteration_limit | diverged | no_target | initial
    converged: bool
    # Eq. 6 after the fit, with the colours believed before it; NaN where nothing was to be compared [-].
    loss_known: float = float("nan")


@dataclass(frozen=True, eq=False)
class _SeenTarget:
    """The target in one image, and what it is compared with."""

    stamp_ns: int
    renderer: TargetRenderer
    real: RealTarget
    misfit: Misfit
    before: Losses  # at the parameters believed so far


@dataclass(frozen=True, eq=False)
class _Belief:
    """The part of an `Estimate` that a fit changes."""

    values: np.ndarray  # (P,)
    covariance: np.ndarray  # (P, P)
    colors: np.ndarray  # (G, 3)
    color_variance: np.ndarray  # (G, 3)


@dataclass(frozen=True)
class _FitLosses:
    before: Losses
    after: Losses
    known: float  # eq. 6 after the fit, with the colours believed before it; NaN where nobody compares


@dataclass(frozen=True)
class Real2SimSettings:
    """Weights of the losses, noise and step control."""

    color_weight: float = 1.0  # lambda_1 [-]
    emd_weight: float = 1.0  # lambda_2 [1/m]
    color_scale: float = 0.5  # unit of a colour's steps, 0..1
    initial_color_deviation: float = 0.3  # of the colours that the model starts with, 0..1
    color_floor: float = 0.02  # error of a colour that no number of pixels removes (shading), 0..1
    drift: float = 1e-4  # the target may move by this between images, standard deviation [unit of value]
    # A fit of rotations, joints or parts whose points and colours both end so many times as far off diverged.
    worse: float = 1.3
    surprise: float = PoseFitSettings.surprise
    motion: float = 0.5  # the same for rotations and joints, which the tool moves [parameter's scale]
    # Error of a size that all images share, so that more do not reduce it: masks a pixel too wide.
    common: float = 0.2  # [parameter's scale]
    least_pixels: int = 40  # fewer pixels of the target than this are "no_target"
    least_thin_pixels: int = 12  # the same of a thread
    other_face: float = 0.7  # a look-alike whose eq. 6, with colours as they were, is this share is taken
    coarse_above: float = 0.012  # distance of the clouds above which EMD alone is reduced first [m]
    polish: int = 2  # noise-weighted Newton steps after the descent
    polish_limit: float = 0.1  # longest of them [parameter's scale]
    jacobian_step: float = 0.035  # half span of the differences for the covariance [parameter's scale]
    noise: ImageNoise = field(default_factory=ImageNoise)
    pose: PoseFitSettings = field(default_factory=PoseFitSettings)  # of rotations and joints
    parts: PartSettings = field(default_factory=PartSettings)  # of targets with several labels
    coarse: MinimizeSettings = MinimizeSettings(
        first_step=0.5, largest_step=1.0, smallest_step=0.03, max_evaluations=14
    )
    fine: MinimizeSettings = MinimizeSettings(
        first_step=0.08, largest_step=0.2, smallest_step=2.5e-3, max_evaluations=36
    )
    warm: MinimizeSettings = MinimizeSettings(
        first_step=0.03, largest_step=0.1, smallest_step=2.5e-3, max_evaluations=18
    )


_LOSSES = ("loss", "color_loss", "emd")
# Losses of an estimate that no image has been fitted to.
_NO_FIT: dict[str, Any] = {
    **dict.fromkeys((f"{name}_{when}" for name in _LOSSES for when in ("before", "after")), float("nan")),
    "loss_known": float("nan"),
    "iterations": 0,
}


def initial_estimate(model: Model) -> Estimate:
    """The declared nominal values, with the declared scales as standard deviations."""
    specs = model.task.parameters()
    colors = np.asarray(model.initial_colors(), dtype=np.float64)
    return Estimate(
        names=tuple(p.name for p in specs),
        values=np.array([p.nominal for p in specs]),
        covariance=np.diag([p.scale**2 for p in specs]),
        color_names=tuple(model.color_names),
        colors=colors,
        color_variance=np.full(colors.shape, Real2SimSettings.initial_color_deviation**2),
        stamp_ns=0,
        **_NO_FIT,
        why_stopped="initial",
        converged=False,
    )


class Real2Sim:
    """Fits the model to images one after the other; the belief travels in the `Estimate`."""

    def __init__(self, model: Model, settings: Real2SimSettings | None = None) -> None:
        self._model = model
        self._settings = settings or Real2SimSettings()
        specs = model.task.parameters()
        self._scale = np.array([p.scale for p in specs])
        self._lower = np.array([p.lower for p in specs])
        self._upper = np.array([p.upper for p in specs])
        self._moves = np.array([p.kind == "state" for p in specs])
        # Of a body's size alone: a wide mask makes it larger from every view.
        self._sized = bool(model.task.body_scales(np.array([p.nominal for p in specs])))
        stays = np.array([self._sized and p.kind == "constant" for p in specs])
        self._common = np.diag(np.where(stays, self._settings.common * self._scale, 0.0) ** 2)
        self._together = acts_together(model.task)

    def update(
        self,
        estimate: Estimate,
        observation: Observation,
        watch: Callable[[np.ndarray], None] | None = None,
        compared: bool = True,
    ) -> Estimate:
        """Reduce eq. 6 over poses and colours, then fuse the fit with the belief before it.

        Coarse: EMD alone, whose gradient reaches across the range. Fine: eq. 6 over poses and colours, along
        the renderer's gradient. The fit's information (`view_information`) gives its covariance; the result
        is the Gaussian product of fit and belief, so that views add up. Rotations and the joints of a chain
        are fitted by `pose_fit`, positions by a step size for each parameter.

        Args:
            estimate: belief before this image.
            observation: image and joints.
            watch: called with the values (P,) as the fit goes on, by `pose_fit` alone.
            compared: whether `likeliest` has others to compare the result with, and so needs `loss_known`.

        Returns:
            A new estimate. `why_stopped` "no_target": too few target pixels, values and colours unchanged;
            "diverged": nothing finite came out or, but for a lone position, colours and points both fit
            clearly worse; values and colours unchanged, the belief as wide as before this image.
        """
        s = self._settings
        if len(self._model.parts) > 1:
            return self._update_parts(estimate, observation, watch, compared)
        joints = observation.tool_arm.position
        real = RealTarget.of(observation, self._model.target_label, self._model.chain_reach(joints))
        renderer = TargetRenderer(self._model, observation.camera, joints, real.clear)
        if min(real.pixels, len(real.cloud)) < (s.least_thin_pixels if renderer.thin else s.least_pixels):
            return _without_target(estimate, observation.stamp_ns)
        misfit = Misfit(renderer, real, s.color_weight, s.emd_weight)
        before = misfit.losses(estimate.values, estimate.colors)
        seen = _SeenTarget(observation.stamp_ns, renderer, real, misfit, before)
        if self._together:
            return self._update_together(estimate, seen, watch, compared)
        return self._update_apart(estimate, seen, compared)

    def _update_parts(
        self,
        estimate: Estimate,
        observation: Observation,
        watch: Callable[[np.ndarray], None] | None,
        compared: bool,
    ) -> Estimate:
        """`update` where the target has several labels; without its first part nothing is fitted."""
        s = self._settings
        seen = seen_parts(self._model, estimate.values, observation, s.parts)
        if not seen or seen[0].number != 0:
            return _without_target(estimate, observation.stamp_ns)
        fitting = PartFit(self._model, seen, s.parts, s.pose, (s.color_weight, s.emd_weight))
        before = fitting.losses(estimate.values, estimate.colors)
        belief = estimate.covariance + np.diag(
            np.where(self._moves, s.parts.motion * self._scale, s.drift) ** 2
        )
        fit = fitting.fit(estimate.values, estimate.colors, belief, s.worse, watch)
        if fit.why_stopped == "diverged":
            return _diverged(estimate, observation.stamp_ns, belief, before, fit.evaluations)
        pixels = fitting.group_pixels(fit.values, fit.colors)
        found = _Belief(fit.values, fit.covariance, *self._fuse_colors(estimate, fit.colors, pixels))
        known = fitting.losses(fit.values, estimate.colors).total if compared else float("nan")
        losses = _FitLosses(before, fitting.losses(fit.values, found.colors), known)
        return _fitted(estimate, observation.stamp_ns, found, losses, fit.evaluations, fit.why_stopped)

    def _update_apart(self, estimate: Estimate, seen: _SeenTarget, compared: bool) -> Estimate:
        """`update` of a position, each coordinate with a step size of its own."""
        s, misfit, renderer, before = self._settings, seen.misfit, seen.renderer, seen.before
        start, coarse_evaluations = estimate.values, 0
        cold = before.emd > s.coarse_above
        if cold:
            coarse = minimize(misfit.coarse, start, self._scale, self._lower, self._upper, s.coarse)
            start, coarse_evaluations = coarse.parameters, coarse.evaluations
        fit = self._fit(misfit, start, estimate.colors, s.fine if cold or not estimate.stamp_ns else s.warm)
        count = self._scale.size
        evaluations = coarse_evaluations + fit.evaluations
        if fit.why_stopped == "diverged":
            return _diverged(estimate, seen.stamp_ns, estimate.covariance, before, evaluations)
        fitted, colors = fit.parameters[:count], fit.parameters[count:].reshape(-1, 3)

        def view_at(values: np.ndarray) -> ViewInformation:
            step = s.jacobian_step * self._scale
            return view_information(lambda v: renderer.image(v, colors), values, step, s.noise)

        view = view_at(fitted)
        for _ in range(s.polish):
            change = newton_step(view, seen.real.image)
            if not np.all(np.abs(change) < s.polish_limit * self._scale):
                break  # too far for the linear model: the descent's answer stands
            fitted = np.clip(fitted + change, self._lower, self._upper)
            view = view_at(fitted)
        belief = estimate.covariance + s.drift**2 * np.eye(count)
        values, covariance = fused(estimate.values, belief, fitted, view.matrix, s.surprise)
        values = np.clip(values, self._lower, self._upper)
        pixels = renderer.group_pixels(values, colors)
        found = _Belief(values, covariance, *self._fuse_colors(estimate, colors, pixels))
        known = misfit.losses(values, estimate.colors).total if compared else float("nan")
        losses = _FitLosses(before, misfit.losses(values, found.colors), known)
        return _fitted(estimate, seen.stamp_ns, found, losses, evaluations, fit.why_stopped)

    def _update_together(
        self,
        estimate: Estimate,
        seen: _SeenTarget,
        watch: Callable[[np.ndarray], None] | None,
        compared: bool,
    ) -> Estimate:
        """`update` of a pose, or of all parameters that act together."""
        s, misfit, renderer, before = self._settings, seen.misfit, seen.renderer, seen.before
        drifts = self._moves if self._sized else np.ones_like(self._moves)
        belief = estimate.covariance + np.diag(np.where(drifts, s.motion * self._scale, s.drift) ** 2)
        fit = fit_pose(
            renderer, seen.real, misfit, estimate.values, estimate.colors, belief, s.noise, s.pose, watch
        )
        fit, loss_known = self._right_face(fit, estimate.colors, seen, belief, compared)
        pixels = renderer.group_pixels(fit.values, fit.colors)
        colors = self._fuse_colors(estimate, fit.colors, pixels)
        if not fit.covers and self._model.task.look_alikes(fit.values):
            # A pancake that falls, believed elsewhere, paints one face with the other: then no colour tells
            # them apart any more.
            colors = (estimate.colors, estimate.color_variance)
        found = _Belief(fit.values, fit.covariance + self._common, *colors)
        after = misfit.losses(fit.values, found.colors)
        if fit.why_stopped == "diverged" or after.farther_than(before, s.worse):
            return _diverged(estimate, seen.stamp_ns, belief, before, fit.evaluations)
        losses = _FitLosses(before, after, loss_known)
        return _fitted(estimate, seen.stamp_ns, found, losses, fit.evaluations, fit.why_stopped)

    def _fuse_colors(
        self, estimate: Estimate, colors: np.ndarray, pixels: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Colours (G, 3) and their variance after a fit that shows so many pixels (G,) of each group."""
        s, known = self._settings, (estimate.colors, estimate.color_variance)
        return fused_colors(*known, colors, pixels, s.noise, s.color_floor)

    def _right_face(
        self, fit: PoseFit, colors: np.ndarray, seen: _SeenTarget, belief: np.ndarray, compared: bool
    ) -> tuple[PoseFit, float]:
        """The fit, or that of a look-alike that colours known before speak for, or that alone is possible.

        With its eq. 6 by those colours. A fit that took the wrong face of a disc paints it in the other's
        colour, and would be right for ever.
        """
        s, misfit, task = self._settings, seen.misfit, self._model.task
        look_alikes = task.look_alikes(fit.values)
        if not (compared or look_alikes):
            return fit, float("nan")
        loss = misfit.losses(fit.values, colors).total
        for values in look_alikes:
            forced = task.is_possible(values) and not task.is_possible(fit.values)
            least = math.inf if forced else s.other_face * loss
            if misfit.losses(values, colors).total < least:
                other = fit_pose(seen.renderer, seen.real, misfit, values, colors, belief, s.noise, s.pose)
                found = misfit.losses(other.values, colors).total
                if found < least:
                    fit, loss = replace(other, evaluations=fit.evaluations + other.evaluations), found
        return fit, loss

    def _fit(
        self, misfit: Misfit, values: np.ndarray, colors: np.ndarray, steps: MinimizeSettings
    ) -> Minimum:
        """The least of eq. 6 over values (P,) and colours (G, 3); what is not the target keeps its colours.

        A screen before the target shows at the edge of the masks; fitted to these few pixels it would turn
        black or red, and so would the images that actor and Q are shown.
        """
        count, targets = len(values), self._model.target_groups
        scale = np.concatenate([self._scale, np.full(3 * len(targets), self._settings.color_scale)])
        lower = np.concatenate([self._lower, np.zeros(3 * len(targets))])
        upper = np.concatenate([self._upper, np.ones(3 * len(targets))])

        def whole(some: np.ndarray) -> np.ndarray:
            every = colors.copy()
            every[targets] = some[count:].reshape(-1, 3)
            return np.concatenate([some[:count], every.ravel()])

        def objective(some: np.ndarray) -> tuple[float, np.ndarray]:
            loss, gradient = misfit.fine(whole(some))
            return loss, np.concatenate([gradient[:count], gradient[count:].reshape(-1, 3)[targets].ravel()])

        start = np.concatenate([values, colors[targets].ravel()])
        found = minimize(objective, start, scale, lower, upper, steps)
        return replace(found, parameters=whole(found.parameters))


def _without_target(last: Estimate, stamp_ns: int) -> Estimate:
    """After an image that does not show the target."""
    return replace(last, stamp_ns=stamp_ns, **_NO_FIT, why_stopped="no_target", converged=False)


def _diverged(
    last: Estimate, stamp_ns: int, covariance: np.ndarray, losses: Losses, iterations: int
) -> Estimate:
    """After a fit that came to nothing: values and colours stay, known no better than was believed."""
    kept = _Belief(last.values, covariance, last.colors, last.color_variance)
    return _fitted(
        last, stamp_ns, kept, _FitLosses(losses, losses, losses.total), iterations, why_stopped="diverged"
    )


def _fitted(
    last: Estimate, stamp_ns: int, found: _Belief, losses: _FitLosses, iterations: int, why_stopped: str
) -> Estimate:
    before, after = losses.before, losses.after
    return replace(
        last,
        values=found.values,
        covariance=found.covariance,
        colors=found.colors,
        color_variance=found.color_variance,
        stamp_ns=stamp_ns,
        loss_before=before.total,
        loss_after=after.total,
        color_loss_before=before.color,
        color_loss_after=after.color,
        emd_before=before.emd,
        emd_after=after.emd,
        iterations=iterations,
        why_stopped=why_stopped,
        converged=why_stopped == "converged",
        loss_known=losses.known,
    )
