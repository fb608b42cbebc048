"""Forms of effects on the motion of a free body: columns per unit, and how large a unit is plausible."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from samrl_core.diagnosis.effects.form import Form, Shape
from samrl_core.diagnosis.residuals.bodies.body_trial import BodyTrial
from samrl_core.diagnosis.residuals.equations import Columns


@dataclass(frozen=True, eq=False, kw_only=True)
class OfMotion(Form[BodyTrial]):
    """Errors of the model to which what the body does is proportional."""

    deviation: ClassVar[float] = 0.0
    of: Callable[[BodyTrial], Columns]  # (p, N) per unit amplitude
    spreads: tuple[float, ...]  # standard deviations of the amplitudes before any data, times the shape's
    # A small error and a gross one are different things that happen.
    shapes: tuple[Shape, ...] = ({"spread": 0.3}, {"spread": 1.0}, {"spread": 4.0})
    surprise: float = 0.0  # [nat] by which the form is less likely before any data
    reported: Callable[[BodyTrial, np.ndarray], dict[str, float]] | None = None  # None: amplitudes by name

    def columns(self, trial: BodyTrial, shape: Shape) -> Columns:
        return self.of(trial)

    def prior(self, trial: BodyTrial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(len(self.spreads)), shape["spread"] * np.array(self.spreads)

    def cost(self, trials: Sequence[BodyTrial], shape: Shape) -> float:
        return self.surprise

    def parameters(self, trial: BodyTrial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        if self.reported is not None:
            return self.reported(trial, amplitudes)
        return dict(zip(self.amplitudes, map(float, amplitudes), strict=True))


def needs_flight(trial: BodyTrial) -> str | None:
    """Why what only scales all accelerations cannot be told; None if it can."""
    if trial.flies:
        return None
    return "in sliding alone it is one with the friction that is felt; needs a fall or a toss"
