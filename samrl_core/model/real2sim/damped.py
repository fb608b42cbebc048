"""Damped Newton steps with the curvature that the objective hands in: for parameters that act together.

Steps of their own for each parameter (`minimize`) crawl where parameters pull at the same points, as the
joints of a chain do. There a step must weigh them against each other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from samrl_core.model.real2sim.minimize import Minimum, checked_start


@dataclass(frozen=True, eq=False)
class Local:
    """An objective near one point."""

    value: float
    gradient: np.ndarray  # (N,)
    curvature: np.ndarray  # (N, N) symmetric, without negative eigenvalues; need not be exact

    def plus(self, other: Local, weight: float = 1.0) -> Local:
        """This and `weight` times the other."""
        return Local(
            self.value + weight * other.value,
            self.gradient + weight * other.gradient,
            self.curvature + weight * other.curvature,
        )


@dataclass(frozen=True)
class DampedSettings:
    """Step control. Steps count in the caller's `scale`."""

    max_evaluations: int = 20
    largest_step: float = 1.0  # longest change of a parameter in a step [scale]
    smallest_step: float = 0.01  # converged when a step is below [scale]
    # Converged when two steps in a row decrease the value by less than this share.
    smallest_decrease: float = 1e-3
    patience: int = 4  # converged when so many steps in a row do not help
    first_damping: float = 0.05  # added to the curvature, as a share of its diagonal (Marquardt 1963)
    ease: float = 0.3  # factor on the damping after a step that helped
    brake: float = 4.0  # factor on the damping after one that did not


def minimize_damped(
    objective: Callable[[np.ndarray], Local],
    start: np.ndarray,
    scale: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    settings: DampedSettings,
    watch: Callable[[np.ndarray], None] | None = None,
) -> Minimum:
    """Go down by (H + damping diag H)^-1 g; a step that does not help is taken back and tried shorter.

    Deterministic. A value, gradient or curvature that is not finite ends the search with "diverged" and the
    best parameters before it.

    Args:
        objective: value, gradient and curvature at parameters (N,).
        start: parameters (N,); moved into the bounds first.
        scale: unit of the steps (N,), positive.
        lower: bounds (N,).
        upper: bounds (N,).
        settings: step control.
        watch: called with the best parameters so far after each evaluation.

    Raises:
        InputError: shapes disagree, a scale is not positive, a bound is crossed, or the start is not finite.
    """
    s = settings
    best = trial = checked_start(start, scale, lower, upper)
    here, first, damping, idle, failed = None, np.nan, s.first_damping, 0, 0
    for k in range(s.max_evaluations):
        there = objective(trial)
        if not all(np.isfinite(a).all() for a in (there.value, there.gradient, there.curvature)):
            return Minimum(best, here.value if here else np.inf, first, k + 1, "diverged")
        if here is None:
            here, first = there, there.value
        elif there.value < here.value:
            decrease = (here.value - there.value) / max(abs(here.value), 1e-300)
            idle = idle + 1 if decrease < s.smallest_decrease else 0
            best, here, damping, failed = trial, there, max(damping * s.ease, 1e-4), 0
        else:
            damping, failed = damping * s.brake, failed + 1
        if watch is not None:
            watch(best)
        step = _step(here, best, scale, lower, upper, damping)
        longest = np.abs(step).max() / s.largest_step
        step = step / max(1.0, longest) * scale
        trial = np.clip(best + step, lower, upper)
        if np.abs((trial - best) / scale).max() < s.smallest_step or idle >= 2 or failed >= s.patience:
            return Minimum(best, here.value, first, k + 1, "converged")
    assert here is not None
    return Minimum(best, here.value, first, s.max_evaluations, "iteration_limit")


def _step(
    here: Local, x: np.ndarray, scale: np.ndarray, lower: np.ndarray, upper: np.ndarray, damping: float
) -> np.ndarray:
    """Change of the parameters [scale]; those that push against a bound stay."""
    gradient = here.gradient * scale
    held = ((x <= lower) & (gradient > 0)) | ((x >= upper) & (gradient < 0))
    free = ~held
    step = np.zeros(x.size)
    if free.any():
        h = (here.curvature * np.outer(scale, scale))[np.ix_(free, free)]
        diagonal = np.diag(h)
        # A parameter that nothing pulls at has no curvature of its own; it must not move far either.
        h = h + np.diag(damping * diagonal + 1e-6 * max(float(diagonal.max()), 1e-12))
        step[free] = -np.linalg.solve(h, gradient[free])
    return step
