"""Forms of effects on readings: powers of the depth, or of the time that has passed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from samrl_core.diagnosis.effects.form import Form, Shape
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.readings.reading_trial import ReadingTrial


@dataclass(frozen=True, eq=False, kw_only=True)
class Polynomial(Form[ReadingTrial]):
    """A sum of powers, one amplitude each."""

    deviation: ClassVar[float] = 0.0
    powers: tuple[int, ...]
    spreads: tuple[float, ...]  # standard deviations of the amplitudes before any data
    sign: float = 1.0
    surprise: float = 0.0  # [nat] by which the form is less likely before any data
    done_by: str = ""  # family that can do the same at this place, whatever the readings

    def columns(self, trial: ReadingTrial, shape: Shape) -> Columns:
        return trial.columns(*(self.sign * trial.over**power for power in self.powers))

    def prior(self, trial: ReadingTrial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(len(self.powers)), np.array(self.spreads)

    def cost(self, trials: Sequence[ReadingTrial], shape: Shape) -> float:
        return self.surprise

    def is_done_by(self, trial: ReadingTrial, name: str) -> bool:
        return bool(self.done_by) and name == f"{self.done_by}@{self.place.name}"

    def parameters(self, trial: ReadingTrial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return dict(zip(self.amplitudes, map(float, amplitudes), strict=True))


def needs(trial: ReadingTrial, quantity: str) -> str | None:
    """Why readings of another quantity cannot show an effect; None if they can."""
    return None if trial.recording.quantity == quantity else f"needs readings of {quantity}"
