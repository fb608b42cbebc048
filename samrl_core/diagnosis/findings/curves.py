"""The named effect over the data: what is left of the torque against what drives it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from samrl_core.diagnosis.residuals.motion import RecordedMotion
from samrl_core.diagnosis.residuals.trial import Trial, as_arms
from samrl_core.diagnosis.result import Curve
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, Hypothesis

# What an effect may be plotted against, besides the effort.
AXES: dict[str, tuple[str, Callable[[RecordedMotion], np.ndarray]]] = {
    "velocity": ("velocity [rad/s]", lambda motion: motion.dq),
    "position": ("position [rad]", lambda motion: motion.q),
    "acceleration": ("acceleration [rad/s2]", lambda motion: motion.ddq),
}
MOST_POINTS = 4000
BINS = 80
FIT_POINTS = 800  # of a fit that is no function of what it is plotted against
SCATTER = 0.2  # of the fit's variance within bins, from which on it is none


def curve_of(evidence: Evidence, chosen: Fit, h: Hypothesis) -> Curve | None:
    """Data and fit where the effect acts most strongly; other named effects are taken out."""
    likelihood = evidence.likelihood
    trials = as_arms(likelihood.trials)
    index = chosen.hypotheses.index(h)
    rest = evidence.remainder(chosen)
    # What tolerances cause, a torque offset above all, would shift the data off the curve.
    rest = rest - likelihood.tolerated(rest, evidence.correlation_time)
    own = likelihood.prediction(h.regressors, chosen.amplitudes[index])
    energy = {b: float(np.sum(own[likelihood.blocks[b]] ** 2)) for b in h.regressors.blocks}
    if not any(energy.values()):
        return None
    _, channel, joint = max(energy, key=lambda block: energy[block])
    label, _ = _driver(trials[0], h.effect.curve_over, joint)
    xs, ys, fits = [], [], []
    for block in likelihood.blocks:
        if block[1:] != (channel, joint):
            continue
        trial = trials[block[0]]
        sigma = trial.sigma[channel][:, joint]
        xs.append(_driver(trial, h.effect.curve_over, joint)[1])
        ys.append(likelihood.uncolored(block, rest + own) * sigma)
        fits.append(likelihood.uncolored(block, own) * sigma)
    x, y, f = np.concatenate(xs), np.concatenate(ys), np.concatenate(fits)
    fit = _mean_in_bins(x, f)
    if len(fit[0]) and float(np.mean((f - np.interp(x, *fit)) ** 2)) > SCATTER * float(np.var(f)):
        few = max(1, len(x) // FIT_POINTS)
        fit = x[::few], f[::few]
    step = max(1, len(x) // MOST_POINTS)
    unit = "rad" if channel == "tracking" else "N m"
    joint_name = trials[0].recording.arm.joints[joint]
    return Curve(h.name, label, f"{channel} residual of {joint_name} [{unit}]", x[::step], y[::step], *fit)


def _mean_in_bins(x: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means (B,) of x and of values, in bins that hold as many samples each."""
    edges = np.unique(np.quantile(x, np.linspace(0, 1, BINS + 1)))
    inside = [(x >= low) & (x <= high) for low, high in zip(edges[:-1], edges[1:], strict=True)]
    held = [each for each in inside if each.any()]
    return np.array([x[each].mean() for each in held]), np.array([values[each].mean() for each in held])


def _driver(trial: Trial, over: str, joint: int) -> tuple[str, np.ndarray]:
    """Label and values (N,) of the quantity that an effect is plotted against."""
    motion = trial.motion
    if over == "effort":
        if motion.u is not None:
            return "commanded effort [N m]", motion.u[:, joint]
        if motion.tau is not None:
            return "effort [N m]", motion.tau[:, joint]
        over = "position"
    label, values = AXES[over]
    return label, values(motion)[:, joint]
