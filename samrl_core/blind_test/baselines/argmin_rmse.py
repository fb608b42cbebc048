"""Each family fitted alone at each place; the smallest RMSE is named, always."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.blind_test.baselines.candidates import DELAYS, candidates, picked, whitened, whitened_columns
from samrl_core.blind_test.baselines.claim import NOTHING, Claim
from samrl_core.blind_test.baselines.samples import make_samples
from samrl_core.cell.types.arm_recording import ArmRecording


def argmin_rmse(fit: Sequence[ArmRecording]) -> Claim:
    """Least squares on the torque residual; nothing speaks against more parameters, or against a name."""
    s = make_samples(fit, DELAYS)
    residual = whitened(s)
    best = NOTHING
    for c in candidates(s, DELAYS):
        columns, y = whitened_columns(s, c), picked(residual, c)
        x = columns.reshape(-1, columns.shape[-1])
        theta, *_ = np.linalg.lstsq(x, y.ravel(), rcond=None)
        decrease = float(np.sum(y**2) - np.sum((y.ravel() - x @ theta) ** 2)) / residual.size
        if decrease > best.score:
            best = Claim(c.family, c.place, decrease)
    return best
