"""What the description of an image recording leaves open: calibration, lens, clocks, object and paint."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.images.image_trial import ImageTrial
from samrl_core.diagnosis.residuals.images.spreads import stated_spreads

UNKNOWN = ("object",)  # solved from the recordings themselves


def tolerance_columns(trial: ImageTrial, widened: float = 1.0) -> list[tuple[Columns, float]]:
    """Regressors (one row each) and standard deviations."""
    out: list[tuple[Columns, float]] = []
    for name, widths in stated_spreads(trial.recording.tolerances, widened).items():
        columns = trial.column(name)
        out += [({key: rows[[k]] for key, rows in columns.items()}, w) for k, w in enumerate(widths)]
    return out


def unknown_columns(trial: ImageTrial) -> np.ndarray:
    """Which of the tolerance columns belong to the object's pose, as a mask."""
    spreads = stated_spreads(trial.recording.tolerances)
    return np.array([name in UNKNOWN for name, widths in spreads.items() for _ in widths])
