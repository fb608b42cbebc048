"""The least standard deviations that recorded images allow an effect's parameters: the bound by information.

Gaussian noise as the recordings have it. Beside the effect, what nobody states is open: the object's pose,
light and paint. All else is taken to be as stated, so that no estimate without bias is surer (Cramer-Rao
bound with priors on what is open: van Trees 1968, section 2.4).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.diagnosis.residuals.images.expected import OPEN
from samrl_core.diagnosis.residuals.images.image_trial import ImageTrial
from samrl_core.diagnosis.residuals.images.spreads import SIZES, stated_spreads
from samrl_core.diagnosis.residuals.likelihood import Block


def least_deviations(trials: Sequence[ImageTrial], columns: dict[Block, np.ndarray], unit: int) -> np.ndarray:
    """Standard deviations (p,) of amplitudes with columns (p, n) by block, in units of the noise.

    Args:
        trials: recordings that are fitted.
        columns: of the effect.
        unit: p.

    Returns:
        infinite for an amplitude that the images do not show.
    """
    sizes = [SIZES[name] for name in OPEN]
    information, mixed = np.zeros((unit, unit)), np.zeros((sum(sizes), unit))
    left = np.eye(sum(sizes))
    for r, trial in enumerate(trials):
        spreads = stated_spreads(trial.recording.tolerances)
        for channel in trial.channels:
            noise = trial.sigma[channel][:, 0]
            opened = np.concatenate(
                [
                    spreads[name][:, None]
                    * trial.column(name).get((channel, 0), np.zeros((size, len(noise))))
                    / noise
                    for name, size in zip(OPEN, sizes, strict=True)
                ]
            )
            left += opened @ opened.T
            if (rows := columns.get((r, channel, 0))) is not None:
                information += rows @ rows.T
                mixed += opened @ rows.T
    information -= mixed.T @ np.linalg.solve(left, mixed)
    values, vectors = np.linalg.eigh(information)
    seen = values > 1e-12 * max(float(values.max(initial=0.0)), 1e-300)
    if not seen.all():
        hidden = (np.abs(vectors[:, ~seen]) > 1e-6).any(axis=1)
    else:
        hidden = np.zeros(unit, dtype=bool)
    variances = (vectors[:, seen] ** 2 / values[seen]).sum(axis=1)
    return np.where(hidden, np.inf, np.sqrt(variances))
