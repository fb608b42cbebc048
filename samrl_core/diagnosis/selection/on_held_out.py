"""What a fit leaves and wins on held-out recordings, where nothing is fitted again."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.hypothesis import Fit, hypothesis

SHOWN = 8.0  # [nat] that a further effect must be worth on held-out recordings before they deny it
FORETOLD = 0.3  # of what it should win there: a right effect wins more, its formula nearly right
EXCUSED = 3.0  # standard deviations of noise, by which a right effect may win less than it should


def held_out_remainder(held_out: Likelihood, fit: Fit) -> np.ndarray:
    """Held-out residuals with the fitted effects taken out; nothing is fitted again."""
    y = held_out.y
    for h, amplitudes in zip(fit.hypotheses, fit.amplitudes, strict=True):
        there = hypothesis(held_out, h.effect, h.form, h.shape)
        if there is not None:
            y = held_out.minus(there.regressors, amplitudes, y)
    return y


def held_out_gains(held_out: Likelihood, fit: Fit, correlation: float) -> tuple[float, float]:
    """Log likelihood [nat] that held-out residuals win by a fit as it is, and would win were it exact."""
    if not held_out.blocks:
        return 0.0, 0.0
    return gains(held_out, held_out.y - held_out_remainder(held_out, fit), held_out.y, correlation)


def gains(held_out: Likelihood, p: np.ndarray, y: np.ndarray, correlation: float) -> tuple[float, float]:
    """What residuals y (N,) win by a prediction p (N,), p' S^-1 (y - p / 2), and p' S^-1 p / 2 [nat]."""
    weighed = (p - held_out.tolerated(p, correlation)) / correlation
    expected = 0.5 * float(weighed @ p)
    return float(weighed @ y) - expected, expected


def are_denied(won: float, expected: float, least: float) -> bool:
    """Whether held-out recordings deny a prediction that should win `expected` [nat] there and wins `won`.

    They do below the share `least`, whatever noise there is, and below `FORETOLD` where noise is no excuse: a
    right prediction's log likelihood ratio has the mean `expected`, and the variance twice that.
    """
    if expected <= SHOWN:
        return False
    short = won < FORETOLD * expected and won < expected - EXCUSED * float(np.sqrt(2.0 * expected))
    return won < least * expected or short
