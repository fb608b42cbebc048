"""41: lens distortion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.diagnosis.effects.effect import Effect, Parameter
from samrl_core.diagnosis.effects.form import Form, Place, Shape
from samrl_core.diagnosis.effects.image_forms import ImageColumns
from samrl_core.diagnosis.residuals.images.flows import lens_flows
from samrl_core.diagnosis.residuals.images.frames import compared_size
from samrl_core.diagnosis.residuals.images.image_trial import ImageTrial

WHOLE_PIXEL = 1.0 / 12.0  # variance of a place that is rounded to whole pixels [px^2]
GRID = 32  # points along each side of the image, over which its shift is taken


class LensDistortion(Effect[ImageTrial]):
    """Straight lines bend towards the image's edge otherwise than calibrated."""

    family, number, title = "lens_distortion", 41, "Lens distortion"
    meaning = "Straight lines bend towards the image's edge more or less than calibrated."
    remedy = "Calibrate the distortion with targets that reach the image's corners."
    formula = "x' = x (1 + k1 r2 + k2 r4) + 2 p1 x y + p2 (r2 + 2 x2)"
    source = "Brown 1966; k1 within +-0.05"
    acts_on = "reading"
    place_kind = "sensor"
    excitation = "objects in the image's corners"
    confounded_with = ("intrinsics", "rolling_shutter")
    parameters = (
        Parameter("k1", "1", -0.5, 0.5, "radial, second order"),
        Parameter("k2", "1", -0.5, 0.5, "radial, fourth order"),
        Parameter("p1", "1", -0.05, 0.05, "tangential"),
        Parameter("p2", "1", -0.05, 0.05, "tangential"),
        Parameter("shift", "px", 0.0, 50.0, "by all of them, root mean square over the image as recorded"),
    )
    simulated = False

    def forms(self, trial: ImageTrial, place: Place) -> tuple[Form[ImageTrial], ...]:
        radial = Lens(
            name="radial", place=place, amplitudes=("k1", "k2"), columns_of=("radial",), spreads=(0.06, 0.06)
        )
        whole = Lens(
            name="with tangential",
            place=place,
            amplitudes=("k1", "k2", "p1", "p2"),
            columns_of=("radial", "tangential"),
            spreads=(0.06, 0.06, 0.003, 0.003),
        )
        return (radial, whole)


@dataclass(frozen=True, eq=False, kw_only=True)
class Lens(ImageColumns):
    """Coefficients may cancel each other: beside them stands by how much they move the image together."""

    def parameters(self, trial: ImageTrial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        squares = _squares(trial.recording.intrinsics)[: len(amplitudes), : len(amplitudes)]
        shift = float(np.sqrt(max(amplitudes @ squares @ amplitudes, 0.0)))
        return {**super().parameters(trial, shape, amplitudes), "shift": shift}

    def find_unresolved(self, trial: ImageTrial, shape: Shape) -> np.ndarray:
        """Lenses that differ by less than what reading at whole pixels does to a place look the same.

        Depth and labels are those of the nearest pixel, and where a lens moves them by less than half of one,
        it moves none of them: in every frame alike, so that no number of frames tells more.
        """
        count = len(self.amplitudes)
        squares = _squares(compared_size(trial.recording.intrinsics)[0])[:count, :count]
        _, spread = self.prior(trial, shape)
        return np.linalg.inv(squares / WHOLE_PIXEL + np.diag(1.0 / spread**2))


@cache
def _squares(k: Intrinsics) -> np.ndarray:
    """Mean products (4, 4) of the shifts of an image's points by k1, k2, p1 and p2 of one [px^2]."""
    u, v = np.meshgrid(*((np.arange(GRID) + 0.5) * size / GRID for size in (k.width, k.height)))
    rays = np.stack([(u - k.cx) / k.fx, (v - k.cy) / k.fy, np.ones_like(u)], axis=-1).reshape(-1, 3)
    of = lens_flows(k, rays)
    moves = np.concatenate([of["radial"], of["tangential"]])[..., :2] * [k.fx, k.fy]
    return np.einsum("pni,qni->pq", moves, moves) / len(rays)


EFFECT = LensDistortion()
