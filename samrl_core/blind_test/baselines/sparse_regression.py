"""Sequentially thresholded least squares on the residual (Brunton, Proctor and Kutz, PNAS 113, 2016)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.blind_test.baselines.candidates import MIDDLE_DELAY, candidates, whitened
from samrl_core.blind_test.baselines.claim import NOTHING, Claim
from samrl_core.blind_test.baselines.normal_equations import NormalEquations, normal_equations
from samrl_core.blind_test.baselines.samples import make_samples
from samrl_core.cell.types.arm_recording import ArmRecording

THRESHOLDS = (
    0.1,
    0.15,
    0.2,
    0.3,
    0.4,
)  # of a coefficient's range; chosen on the last quarter of each recording
ROUNDS = 10


def sparse_regression(fit: Sequence[ArmRecording]) -> Claim:
    """The surviving term that explains most is named; nothing if the empty model predicts best."""
    s = make_samples(fit, MIDDLE_DELAY)
    library, residual = list(candidates(s, MIDDLE_DELAY)), whitened(s)
    late = np.zeros(len(s.time), bool)
    for k in np.unique(s.recording):
        rows = np.flatnonzero(s.recording == k)
        late[rows[int(0.75 * len(rows)) :]] = True
    early = normal_equations(s, library, residual, ~late)
    validation = normal_equations(s, library, residual, late)
    best, best_loss = np.zeros(len(early.owner)), validation.energy
    for threshold in THRESHOLDS:
        theta = _thresholded(early, threshold)
        if (loss := validation.loss(theta)) < best_loss:
            best, best_loss = theta, loss
    if not best.any():
        return NOTHING
    losses_without = {}
    for k in np.unique(early.owner[best != 0]):
        without = np.where(early.owner == k, 0.0, best)
        losses_without[int(k)] = early.loss(without) - early.loss(best)
    strongest = max(losses_without, key=lambda k: losses_without[k])
    return Claim(
        library[strongest].family, library[strongest].place, float(losses_without[strongest] / early.energy)
    )


def _thresholded(equations: NormalEquations, threshold: float) -> np.ndarray:
    active = np.ones(len(equations.owner), bool)
    theta = equations.solve(active)
    for _ in range(ROUNDS):
        selected = np.abs(theta) >= threshold
        if (selected == active).all():
            break
        active = selected
        theta = equations.solve(active)
    return theta
