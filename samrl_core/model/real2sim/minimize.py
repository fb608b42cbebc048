"""Gradient descent with a step of its own for each parameter (eq. 7's lambda_M, adapted)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from samrl_core.common.errors import InputError

Objective = Callable[[np.ndarray], tuple[float, np.ndarray]]  # parameters -> value, gradient


@dataclass(frozen=True)
class MinimizeSettings:
    """How far the steps may grow, and when to stop. Steps count in the caller's `scale`."""

    first_step: float = 0.1  # [scale]
    largest_step: float = 0.5  # [scale]
    smallest_step: float = 2e-3  # converged when every step is below [scale]
    growth: float = 1.2  # factor while a gradient keeps its sign (Riedmiller and Braun 1993)
    shrink: float = 0.5  # factor when a gradient changes its sign (the same)
    max_evaluations: int = 40


@dataclass(frozen=True, eq=False)
class Minimum:
    """The best point met on the way."""

    parameters: np.ndarray  # (N,)
    value: float
    first_value: float  # at the start
    evaluations: int
    why_stopped: str  # converged | iteration_limit | diverged


def minimize(
    objective: Objective,
    start: np.ndarray,
    scale: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    settings: MinimizeSettings,
) -> Minimum:
    """Follow the sign of each gradient component with a step that grows on agreement and halves on a change
    of sign.

    Absolute differences (eq. 4) have gradients whose size does not depend on the distance to the minimum and
    jump across it; the sign is what is left, and the step halves at each crossing. This is Rprop (Riedmiller
    and Braun 1993) with the memory of iRprop- (Igel and Huesken 2003), which stands still for one evaluation
    after a crossing, where this goes back by the halved step at once. No random numbers: the same input gives
    the same bits.
    A value or gradient that is not finite stops with "diverged" and the best parameters before it.

    Args:
        objective: returns the value and the gradient (N,).
        start: parameters (N,); moved into the bounds first.
        scale: unit of the steps per parameter (N,), positive.
        lower: bounds (N,).
        upper: bounds (N,).
        settings: step control.

    Raises:
        InputError: shapes disagree, a scale is not positive, a bound is crossed, or the start is not finite.
    """
    x = checked_start(start, scale, lower, upper)
    step = np.full(x.shape, settings.first_step)
    last_sign = np.zeros(x.shape)
    best, best_value, first_value = x, np.inf, np.nan
    for k in range(settings.max_evaluations):
        value, gradient = objective(x)
        if not (np.isfinite(value) and np.isfinite(gradient).all()):
            return Minimum(best, float(best_value), float(first_value), k + 1, "diverged")
        if k == 0:
            first_value = value
        if value < best_value:
            best, best_value = x, value
        sign = np.sign(gradient)
        # At a bound that the gradient pushes against there is nowhere to go: such a step is done.
        held = ((x <= lower) & (sign > 0)) | ((x >= upper) & (sign < 0)) | (sign == 0)
        agree = sign * last_sign
        step = np.where(agree > 0, np.minimum(step * settings.growth, settings.largest_step), step)
        step = np.where(agree < 0, step * settings.shrink, step)
        if np.all(held | (step < settings.smallest_step)):
            return Minimum(best, float(best_value), float(first_value), k + 1, "converged")
        # After a change of sign the next gradient is taken as new, as in iRprop-: no double halving.
        last_sign = np.where(agree < 0, 0.0, sign)
        x = np.clip(x - step * sign * scale, lower, upper)
    return Minimum(best, float(best_value), float(first_value), settings.max_evaluations, "iteration_limit")


def checked_start(start: np.ndarray, scale: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """The start (N,) moved into the bounds, float64.

    Raises:
        InputError: shapes disagree, a scale is not positive, a bound is crossed, or the start is not finite.
    """
    x = np.array(start, dtype=np.float64)
    shapes = [np.shape(a) for a in (scale, lower, upper)]
    if x.ndim != 1 or any(shape != x.shape for shape in shapes):
        raise InputError(f"start, scale and bounds must be one shape (N,), got {x.shape} {shapes}")
    if not (np.all(np.asarray(scale) > 0) and np.all(np.asarray(lower) <= np.asarray(upper))):
        raise InputError(f"scale {scale} must be positive and lower {lower} not above upper {upper}")
    if not np.isfinite(x).all():
        raise InputError(f"start {x} is not finite")
    return np.clip(x, lower, upper)
