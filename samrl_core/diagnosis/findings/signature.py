"""What the remainder looks like: hints that name no cause, and joints whose residuals move together."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.result import Signature

HINT = 0.25  # correlation from which on a hint is given
COUPLING = 0.5
MOST = 4  # blocks that are described


def signatures(likelihood: Likelihood, rest: np.ndarray) -> tuple[Signature, ...]:
    """Hints for the blocks with most unexplained energy."""
    power: dict[tuple[str, int], float] = {}
    for (_, channel, j), part in likelihood.blocks.items():
        power[channel, j] = power.get((channel, j), 0.0) + float(np.sum(np.maximum(rest[part] ** 2 - 1.0, 0)))
    out = []
    for channel, j in sorted(power, key=lambda key: -power[key])[:MOST]:
        if power[channel, j] <= 0:
            continue
        hints: dict[str, list[float]] = {}
        for r, trial in enumerate(likelihood.trials):
            if (r, channel, j) not in likelihood.blocks:
                continue
            x = likelihood.uncolored((r, channel, j), rest)
            for name, driver in trial.drivers(channel, j).items():
                hints.setdefault(name, []).append(_correlation(x, driver))
        mean = {name: float(np.mean(values)) for name, values in hints.items()}
        strong = tuple(
            (name, round(value, 2))
            for name, value in sorted(mean.items(), key=lambda item: -abs(item[1]))
            if abs(value) > HINT
        )
        place = likelihood.trials[0].places[j]
        out.append(Signature(place, channel, strong or (("no simple pattern", 0.0),)))
    return tuple(out)


def couplings(likelihood: Likelihood, rest: np.ndarray) -> tuple[tuple[str, str, str, float], ...]:
    """Joints whose residual follows another joint's motion: (joint, driven by, quantity, correlation).

    Each joint's own motion is taken out first, of the residuals before and after what was named: friction on
    a shaft that turns with two joints is a coupling, whether or not it has been explained.
    """
    out = []
    trials = [t for t in likelihood.trials if isinstance(t, Trial)]
    joints = trials[0].recording.arm.joints if trials else ()
    for channel in trials[0].channels if trials else ():
        if channel not in ("drive", "dynamics"):
            continue
        for j, name in enumerate(joints):
            for i, other in enumerate(joints):
                if i == j:
                    continue
                found: dict[str, list[float]] = {}
                for r, trial in enumerate(trials):
                    seen = [likelihood.uncolored((r, channel, j), x) for x in (likelihood.y, rest)]
                    own = _moving(trial, j)
                    for quantity, driver in _moving(trial, i).items():
                        values = [_partial(x, driver, list(own.values())) for x in seen]
                        found.setdefault(quantity, []).append(max(values, key=abs))
                for quantity, values in found.items():
                    if abs(float(np.mean(values))) > COUPLING:
                        out.append((name, other, quantity, round(float(np.mean(values)), 2)))
    return tuple(sorted(out, key=lambda item: -abs(item[3]))[:8])


def _correlation(a: np.ndarray, b: np.ndarray) -> float:
    x, y = a - np.mean(a), b - np.mean(b)
    scale = float(np.sqrt((x @ x) * (y @ y)))
    return float(x @ y) / scale if scale > 0 else 0.0


def _moving(trial: Trial, joint: int) -> dict[str, np.ndarray]:
    """Quantities by which a joint's motion may act on another."""
    drivers = trial.drivers("drive", joint)
    return {name: drivers[name] for name in ("sign of velocity", "velocity", "acceleration")}


def _partial(a: np.ndarray, b: np.ndarray, controls: list[np.ndarray]) -> float:
    """Correlation of a and b with the controls' share taken out of both."""
    basis = np.stack([np.ones_like(a), *controls], axis=1)
    both = np.stack([a, b], axis=1)
    solution, *_ = np.linalg.lstsq(basis / (np.linalg.norm(basis, axis=0) + 1e-300), both, rcond=None)
    left = both - basis / (np.linalg.norm(basis, axis=0) + 1e-300) @ solution
    return _correlation(left[:, 0], left[:, 1])
