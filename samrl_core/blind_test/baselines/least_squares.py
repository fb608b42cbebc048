"""Two plain least-squares baselines: every family alone, and all parameters at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.blind_test.baselines.candidates import (
    DELAYS,
    MIDDLE_DELAY,
    candidates,
    picked,
    whitened,
    whitened_columns,
)
from samrl_core.blind_test.baselines.claim import NOTHING, Claim
from samrl_core.blind_test.baselines.normal_equations import normal_equations
from samrl_core.blind_test.baselines.samples import make_samples
from samrl_core.cell.types.arm_recording import ArmRecording

SMALLEST = 0.1  # of the range; below it nothing is named (lowest severity of the protocol)


def argmin_rmse(fit: Sequence[ArmRecording]) -> Claim:
    """Each family fitted alone at each place; the smallest RMSE of the torque is named, always.

    Nothing speaks against more parameters, or against a name.
    """
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


def all_parameters(fit: Sequence[ArmRecording]) -> Claim:
    """One linear fit of everything; the largest share of its range is named, as PACE identifies a model."""
    s = make_samples(fit, MIDDLE_DELAY)
    library = list(candidates(s, MIDDLE_DELAY))
    equations = normal_equations(s, library, whitened(s), np.ones(len(s.time), bool))
    theta = np.abs(equations.solve(np.ones(len(equations.owner), bool)))
    largest = int(np.argmax(theta))
    if theta[largest] < SMALLEST:
        return NOTHING
    c = library[equations.owner[largest]]
    return Claim(c.family, c.place, float(theta[largest]))
