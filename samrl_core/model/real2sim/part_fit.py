"""Fit of a target whose parts have labels of their own, as a thread and the needle that it goes through.

Each part is led by eq. 6 on its own mask, over the parameters that move nothing else. Then all parts
together, with what the camera shows beside its place, are taken to the likeliest values of image and belief:
a shift that both have in common is the camera's, which two parts fitted apart could not tell.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from samrl_core.cell.types.observation import Observation
from samrl_core.model.model import Model
from samrl_core.model.real2sim.coverage import coverage
from samrl_core.model.real2sim.damped import DampedSettings
from samrl_core.model.real2sim.information import ImageNoise, TargetImage, normal_equations, widened_belief
from samrl_core.model.real2sim.misfit import Losses, Misfit, RealTarget
from samrl_core.model.real2sim.pose_fit import (
    PoseFit,
    PoseFitSettings,
    descend,
    overlap,
    pose_information,
)
from samrl_core.model.real2sim.target_renderer import TargetRenderer
from samrl_core.model.real2sim.thin_mask import clear_of_others
from samrl_core.model.real2sim.thread_line import LineNoise, line_equations
from samrl_core.model.scene.target import Reach, TargetPart

_COVERED = 0.5  # a pixel of which more is the part shows the part [-]


@dataclass(frozen=True)
class PartSettings:
    """How parts are cut out, and what is believed of their images.

    Masks of a thing some pixels wide are mostly boundary: colours say where it is (`coverage`). Depth there
    is a mix of both sides with a bias of millimetres: it leads no fit and counts for little.
    """

    least_pixels: int = 40  # fewer of a part are none
    least_thin_pixels: int = 12  # the same of a thread
    margin: float = 0.04  # what is measured farther from where a part is believed is not the part [m]
    least_overlap: float = 0.8  # as `PoseFitSettings`; masks that are a pixel too wide all around still pass
    # What an image does not fit is widened by so much, or a thread that was lost would never be found again.
    doubt: float = 0.2  # [parameter's scale]
    motion: float = 0.02  # what the tool moves may have moved so far more than predicted [parameter's scale]
    noise: ImageNoise = field(default_factory=lambda: ImageNoise(edge=0.5, shared_by=8.0, depth=0.03))
    line: LineNoise = LineNoise()  # of a thread
    # An outline leaves a thread's way along the view open: the belief has to hold it there while it is led.
    thread: PoseFitSettings = PoseFitSettings(belief_weight=2e-4, fine=DampedSettings(max_evaluations=4))
    polish: int = 10  # steps over all parts at most


@dataclass(frozen=True, eq=False)
class SeenPart:
    """One part of the target that an image shows."""

    number: int  # of `Model.parts`
    real: RealTarget
    observation: Observation
    plane: float  # depth at which clouds are compared [m]
    cover: np.ndarray  # (H, W) share of each pixel that is the part, 0..1

    def renderer(self, model: Model, others: np.ndarray, taken: np.ndarray | None = None) -> TargetRenderer:
        """Of this part; see `TargetRenderer`."""
        o = self.observation
        return TargetRenderer(
            model, o.camera, o.tool_arm.position, self.real.clear, self.number, others, taken, self.plane
        )


@dataclass(frozen=True, eq=False)
class _Step:
    """Equations of one Newton step over all values (P,)."""

    matrix: np.ndarray  # (P, P) information
    normal: np.ndarray  # (P, P) of the step itself
    gradient: np.ndarray  # (P,)
    limit: np.ndarray  # (P,) farthest that a step may go


def seen_parts(
    model: Model, values: np.ndarray, observation: Observation, settings: PartSettings
) -> tuple[SeenPart, ...]:
    """Parts with enough pixels near where they are believed, in their order."""
    joints, found = observation.tool_arm.position, []
    for number, part in enumerate(model.parts):
        reach = model.chain_reach(joints) if part.is_chain else None
        if reach is None:
            corners = model.target_surface(values, joints, number).reshape(-1, 3)
            low, high = corners.min(axis=0), corners.max(axis=0)
            reach = Reach(0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low)) + settings.margin)
        seen = _cut(part, reach, observation)
        least = settings.least_thin_pixels if part.is_chain else settings.least_pixels
        if seen.real.pixels >= least:
            found.append(replace(seen, number=number))
    return tuple(found)


def _cut(part: TargetPart, reach: Reach, observation: Observation) -> SeenPart:
    """The part in an image, without what is measured far from it; its cloud at one depth, as it is seen."""
    frame, camera = observation.frame, observation.camera
    color, depth = frame.color / 255.0, frame.depth.astype(np.float64)
    plane = float(camera.camera_in_world.inverse().apply(reach.center)[2])
    mask, clear, rim = frame.mask == part.label, None, 1
    if part.is_chain:  # its pixels' depth is often that of what lies behind
        v, u = np.mgrid[: mask.shape[0], : mask.shape[1]] + 0.5
        middle = camera.project(reach.center[None])[0, :2]
        mask &= np.hypot(u - middle[0], v - middle[1]) < reach.radius * camera.intrinsics.fx / plane
        others = (frame.mask != 0) & (frame.mask != part.label)
        cover, rim = coverage(color, mask, True, others), 0
        clear = clear_of_others(frame.mask, part.label, cover > _COVERED)
        mask = (cover > _COVERED) & clear
    else:
        far = np.linalg.norm(camera.unproject(depth) - reach.center, axis=-1) > reach.radius  # not where NaN
        depth = np.where(far, np.nan, depth)
        cover = coverage(color, mask & ~far, False)
        mask = cover > _COVERED
    image = TargetImage(color * mask[..., None], depth, mask, rim)
    cloud = camera.unproject(np.full(mask.shape, plane))[mask]
    return SeenPart(0, RealTarget(image, cloud, int(mask.sum()), clear), observation, plane, cover)


class PartFit:
    """Fits the parts of one image.

    Args:
        model: of the task.
        seen: parts that the image shows, one at least.
        parts: noise, and when a part fits.
        settings: as of `fit_pose`.
        weights: of colour and points in eq. 6.
    """

    def __init__(
        self,
        model: Model,
        seen: Sequence[SeenPart],
        parts: PartSettings,
        settings: PoseFitSettings,
        weights: tuple[float, float],
    ) -> None:
        self._model, self._seen, self._parts, self._settings = model, tuple(seen), parts, settings
        self._weights = weights
        specs = model.task.parameters()
        self._scale, self._lower, self._upper = np.array([[p.scale, p.lower, p.upper] for p in specs]).T
        self._nominal = np.array([p.nominal for p in specs])
        self._moves = np.array([p.kind == "state" for p in specs])

    def losses(self, values: np.ndarray, colors: np.ndarray) -> Losses:
        """Eqs. 4 to 6, the mean over the parts that are seen."""
        each = [self._losses(one, values, colors) for one in self._seen]
        return Losses(*(float(np.mean([getattr(x, n) for x in each])) for n in ("total", "color", "emd")))

    def fit(
        self,
        start: np.ndarray,
        colors: np.ndarray,
        belief: np.ndarray,
        worse: float,
        watch: Callable[[np.ndarray], None] | None = None,
    ) -> PoseFit:
        """The values (P,) that image and belief make likeliest; a part that does not fit says nothing.

        Args:
            start: mean of the belief (P,).
            colors: of all surface groups (G, 3).
            belief: covariance of the belief (P, P).
            worse: a part whose points and colours both end this many times farther off does not fit.
            watch: as of `fit_pose`.
        """
        s, values, known, evaluations = self._settings, start.copy(), colors, 0
        why = "converged"
        for one in self._seen:
            part = self._model.parts[one.number]
            own = part.parameters[part.own]
            renderer = one.renderer(self._model, values, own)
            misfit = Misfit(renderer, one.real, *self._weights)
            led_by = self._parts.thread if part.is_chain else s
            found = descend(renderer, one.real, misfit, values[own], colors, belief[np.ix_(own, own)], led_by)
            values[own], colors = found.values, found.colors
            evaluations += found.evaluations
            if watch is not None:
                watch(values)
        used, doubt = self._seen, np.zeros(len(start))
        while used:
            values, covariance, why = self._polished(used, start, values, colors, belief, watch)
            good = tuple(one for one in used if self._fits(one, start, values, (known, colors), worse))
            if len(good) == len(used):
                why = "iteration_limit" if doubt.any() else why
                return PoseFit(values, self._doubted(covariance, doubt, values), colors, evaluations, why)
            for one in used:
                if one not in good:  # a mask of something else, or a fit that has not arrived yet
                    self._leave(one, start, values, known, colors)
                    part = self._model.parts[one.number]
                    own = part.parameters[part.own]
                    # Colours and points alone led it here: along the view it is no more than a place to go on
                    # from, and a belief as narrow as before would keep it there.
                    doubt[own] = np.hypot(self._unfit(belief)[own], values[own] - start[own])
            used = good
        camera = np.array([p.kind == "camera" for p in self._model.task.parameters()])
        values[camera] = start[camera]
        came_nearer = not np.array_equal(values, start)
        why = "iteration_limit" if came_nearer else "diverged"
        return PoseFit(values, self._doubted(belief, doubt, values), known, evaluations, why)

    def _unfit(self, belief: np.ndarray) -> np.ndarray:
        """Deviations (P,) that what an image does not fit is widened by.

        What does not move is doubted by no more than it was known: one image that fits nothing opens a length
        that many have told by a factor of 1.4, the fourth in a row by 4.
        """
        most = self._parts.doubt * self._scale
        return np.where(self._moves, most, np.minimum(most, np.sqrt(np.diag(belief))))

    def _doubted(self, covariance: np.ndarray, doubt: np.ndarray, values: np.ndarray) -> np.ndarray:
        """A covariance (P, P) about values (P,), wider by deviations (P,), but by none beyond the prior's.

        About values that lie elsewhere than the nominal ones the prior is as wide as both ways together.
        Doubt that grows with each image that fits nothing would in the end believe any image that fits.
        """
        most = self._scale**2 + (values - self._nominal) ** 2
        room = np.maximum(most - np.diag(covariance), 0.0)
        return covariance + np.diag(np.minimum(doubt**2, room))

    def _leave(
        self,
        one: SeenPart,
        start: np.ndarray,
        values: np.ndarray,
        known: np.ndarray,
        colors: np.ndarray,
    ) -> None:
        """What was believed of a part that does not fit stands; a thread that came nearer goes on from it."""
        part = self._model.parts[one.number]
        own, colors[part.groups] = part.parameters[part.own], known[part.groups]
        if not (
            part.is_chain and self._losses(one, values, colors).total < self._losses(one, start, known).total
        ):
            values[own] = start[own]

    def _polished(
        self,
        used: Sequence[SeenPart],
        start: np.ndarray,
        values: np.ndarray,
        colors: np.ndarray,
        belief: np.ndarray,
        watch: Callable[[np.ndarray], None] | None,
    ) -> tuple[np.ndarray, np.ndarray, str]:
        """Noise-weighted Newton steps over all parts: values (P,), covariance (P, P), why it stopped."""
        s, count, why = self._settings, len(values), "iteration_limit"
        precision, covariance = belief, belief
        for k in range(self._parts.polish):
            step = self._equations(used, values, colors)
            if not k:
                precision = np.linalg.inv(widened_belief(start, belief, values, step.matrix, s.surprise))
            covariance = np.linalg.inv(precision + step.matrix)
            change = np.linalg.solve(step.normal + precision, step.gradient + precision @ (start - values))
            squared = float(change @ np.linalg.solve(covariance, change)) / count  # of the whole step
            change = change / max(1.0, float(np.abs(change / step.limit).max()))
            values = np.clip(values + change, self._lower, self._upper)
            if watch is not None:
                watch(values)
            if squared < s.polish_enough**2:
                why = "converged"
                break
        return values, 0.5 * (covariance + covariance.T), why

    def _equations(self, used: Sequence[SeenPart], values: np.ndarray, colors: np.ndarray) -> _Step:
        """What the parts tell of all values about these."""
        count, s = len(values), self._settings
        matrix, normal, gradient = np.zeros((count, count)), np.zeros((count, count)), np.zeros(count)
        limit = self._scale.copy()
        for one in used:
            renderer = one.renderer(self._model, values)
            at = renderer.taken
            if renderer.thin:
                shown = renderer.image(values[at], colors).mask
                line = line_equations(renderer, values[at], one.cover, shown, self._parts.line)
                told, more, side = line.information, line.normal, line.gradient
            else:
                view = pose_information(renderer, values[at], colors, self._parts.noise, s)
                told, (more, side) = view.matrix, normal_equations(view, one.real.image)
            matrix[np.ix_(at, at)] += told
            normal[np.ix_(at, at)] += more
            gradient[at] += side
            limit[at] = np.minimum(limit[at], renderer.pixel_steps(values[at], s.polish_limit))
        return _Step(matrix, normal, gradient, limit)

    def _fits(
        self,
        one: SeenPart,
        start: np.ndarray,
        values: np.ndarray,
        colors: tuple[np.ndarray, np.ndarray],
        worse: float,
    ) -> bool:
        """Whether masks lie on each other, and points or colours are not clearly farther off than before."""
        renderer = one.renderer(self._model, values)
        mask = renderer.image(values[renderer.taken], colors[1]).mask
        if overlap(mask, one.real.image.mask) < self._parts.least_overlap:
            return False
        before, after = self._losses(one, start, colors[0]), self._losses(one, values, colors[1])
        return not after.farther_than(before, worse)

    def _losses(self, one: SeenPart, values: np.ndarray, colors: np.ndarray) -> Losses:
        renderer = one.renderer(self._model, values)
        return Misfit(renderer, one.real, *self._weights).losses(values[renderer.taken], colors)

    def group_pixels(self, values: np.ndarray, colors: np.ndarray) -> np.ndarray:
        """As `TargetRenderer.group_pixels`, over all parts that are seen (G,)."""
        pixels = np.zeros(len(colors))
        for one in self._seen:
            renderer = one.renderer(self._model, values)
            pixels += renderer.group_pixels(values[renderer.taken], colors)
        return pixels
