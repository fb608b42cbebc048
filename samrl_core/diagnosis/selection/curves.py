"""The named effect over the data: what is left of the torque against what drives it."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.result import Curve
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, Hypothesis

OVER_VELOCITY = {
    "coulomb_friction", "viscous_friction", "stribeck_friction", "friction_asymmetry", "thermal_friction",
    "presliding", "load_dependent_friction",
}  # fmt: skip
OVER_POSITION = {
    "position_dependent_friction", "gear_ripple", "cable", "encoder_eccentricity", "encoder_offset",
    "base_tilt", "payload", "link_inertia",
}  # fmt: skip
OVER_ACCELERATION = {"reflected_inertia"}
MOST_POINTS = 4000
BINS = 80


def curve_of(evidence: Evidence, fit: Fit, h: Hypothesis) -> Curve | None:
    """Data and fit where the effect acts most strongly; other named effects are taken out."""
    likelihood = evidence.likelihood
    index = fit.hypotheses.index(h)
    rest = evidence.rest(fit)
    # What tolerances cause, a torque offset above all, would shift the data off the curve.
    rest = rest - likelihood.tolerated(rest, evidence.correlation_time)
    own = likelihood.prediction(h.regressors, fit.amplitudes[index])
    blocks = [b for b in h.regressors.blocks if float(np.sum(own[likelihood.blocks[b]] ** 2)) > 0]
    if not blocks:
        return None
    strongest = max(blocks, key=lambda b: float(np.sum(own[likelihood.blocks[b]] ** 2)))
    channel, joint = strongest[1:]
    xs, ys, fits = [], [], []
    for (r, c, j), part in likelihood.blocks.items():
        if (c, j) != (channel, joint):
            continue
        trial = likelihood.trials[r]
        sigma = trial.equations.sigma[channel][:, joint]
        xs.append(_driver(trial, h.effect.family, joint)[1])
        ys.append((rest[part] + own[part]) * sigma)
        fits.append(own[part] * sigma)
    label = _driver(likelihood.trials[0], h.effect.family, joint)[0]
    x, y, f = np.concatenate(xs), np.concatenate(ys), np.concatenate(fits)
    edges = np.unique(np.quantile(x, np.linspace(0, 1, BINS + 1)))
    middle, mean = [], []
    for low, high in zip(edges[:-1], edges[1:], strict=True):
        inside = (x >= low) & (x <= high)
        if np.any(inside):
            middle.append(float(np.mean(x[inside])))
            mean.append(float(np.mean(f[inside])))
    step = max(1, len(x) // MOST_POINTS)
    unit = "rad" if channel == "tracking" else "N m"
    joint_name = likelihood.trials[0].recording.arm.joints[joint]
    return Curve(
        h.name, label, f"{channel} residual of {joint_name} [{unit}]", x[::step], y[::step],
        np.array(middle), np.array(mean),
    )  # fmt: skip


def _driver(trial: Trial, family: str, joint: int) -> tuple[str, np.ndarray]:
    """Label and values (N,) of the quantity that an effect is plotted against."""
    motion = trial.motion
    if family in OVER_VELOCITY:
        return "velocity [rad/s]", motion.dq[:, joint]
    if family in OVER_POSITION:
        return "position [rad]", motion.q[:, joint]
    if family in OVER_ACCELERATION:
        return "acceleration [rad/s2]", motion.ddq[:, joint]
    if motion.u is not None:
        return "commanded effort [N m]", motion.u[:, joint]
    if motion.tau is not None:
        return "effort [N m]", motion.tau[:, joint]
    return "position [rad]", motion.q[:, joint]
