"""Forms of effects on images: columns of one name, with a spread for each amplitude."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from samrl_core.diagnosis.effects.form import Form, Shape
from samrl_core.diagnosis.effects.pose_forms import RADIAN_PER_METRE
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.images.image_trial import ImageTrial
from samrl_core.diagnosis.residuals.images.spreads import SIZES, stated_spreads


@dataclass(frozen=True, eq=False, kw_only=True)
class ImageColumns(Form[ImageTrial]):
    """An error whose columns the trial has; its prior is one of several sizes."""

    deviation: ClassVar[float] = 0.0
    columns_of: tuple[str, ...]
    spreads: tuple[float, ...]  # standard deviations of the amplitudes at scale 1
    shapes: tuple[Shape, ...] = field(default=({"scale": 1.0}, {"scale": 3.0}))
    surprise: float = 0.0  # [nat] by which the form is less likely before any data

    def columns(self, trial: ImageTrial, shape: Shape) -> Columns:
        return trial.stacked(*self.columns_of)

    def prior(self, trial: ImageTrial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(len(self.spreads)), shape["scale"] * np.array(self.spreads)

    def find_own_tolerances(self, trial: ImageTrial) -> np.ndarray:
        return np.concatenate([_tolerance_of(trial, name) for name in self.columns_of])

    def cost(self, trials: object, shape: Shape) -> float:
        return self.surprise

    def parameters(self, trial: ImageTrial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return dict(zip(self.amplitudes, map(float, amplitudes), strict=True))


@dataclass(frozen=True, eq=False, kw_only=True)
class AddedColumns(ImageColumns):
    """One amplitude that moves columns of several names together: both arms' clocks, all outlines."""

    sign: float = 1.0

    def columns(self, trial: ImageTrial, shape: Shape) -> Columns:
        return trial.added(*((self.sign, name) for name in self.columns_of))

    def find_own_tolerances(self, trial: ImageTrial) -> np.ndarray:
        """Of what its columns have in common: the mean of theirs."""
        of_each = np.stack([_tolerance_of(trial, name) for name in self.columns_of])
        return self.sign * of_each.mean(axis=0)


@dataclass(frozen=True, eq=False, kw_only=True)
class ZeroOfJoint(ImageColumns):
    """One column of a name that has one for each joint."""

    index: int

    def columns(self, trial: ImageTrial, shape: Shape) -> Columns:
        return {key: rows[[self.index]] for key, rows in trial.column(self.columns_of[0]).items()}

    def is_done_by(self, trial: ImageTrial, name: str) -> bool:
        """The camera arm's last joint turns the camera about its flange, as a wrong hand-eye does."""
        last = f"joint:{trial.joints['camera'][-1]}"
        return self.place.name == last and name == f"hand_eye@{trial.places[0]}"

    def find_own_tolerances(self, trial: ImageTrial) -> np.ndarray:
        return _tolerance_of(trial, self.columns_of[0])[[self.index]]


def _tolerance_of(trial: ImageTrial, name: str) -> np.ndarray:
    """What each tolerance column adds (p, columns) to the amplitudes of a name's columns."""
    widths = stated_spreads(trial.recording.tolerances)
    return np.concatenate(
        [np.diag(w) if n == name else np.zeros((SIZES[name], len(w))) for n, w in widths.items()], axis=1
    )


SIX_SPREADS = (*(0.003,) * 3, *(0.003 * RADIAN_PER_METRE,) * 3)
