"""Levenberg-Marquardt: nonlinear least squares with the reason for stopping."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from samrl_core.common.errors import InputError, SolveError

Residual = Callable[[np.ndarray], np.ndarray]  # parameters (P,) -> whitened residual (M,)
Slopes = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]  # -> the same, and its Jacobian (M, P)


@dataclass(frozen=True)
class LeastSquaresSettings:
    """When to stop, and how the damping changes (Marquardt 1963, Nielsen's factors simplified)."""

    max_iterations: int = 30
    max_trials: int = 8  # of one step, the damping grown in between
    # Converged when the squared residual would fall by no more: a step of a tenth of a standard deviation.
    small_gain: float = 0.01
    first_damping: float = 1e-2  # share of the curvature's diagonal
    growth: float = 10.0
    shrink: float = 0.2


@dataclass(frozen=True, eq=False)
class LeastSquaresResult:
    """The best point met."""

    parameters: np.ndarray  # (P,)
    residual: np.ndarray  # (M,) there
    jacobian: np.ndarray  # (M, P) there
    path: np.ndarray  # (K + 1, P) accepted points, the start first
    why_stopped: str  # converged | iteration_limit | no_descent | diverged


def least_squares(
    residual: Residual, slopes: Slopes, start: np.ndarray, settings: LeastSquaresSettings | None = None
) -> LeastSquaresResult:
    """Minimise the squared residual.

    A trial point where the model cannot be solved, or gives no number, counts as worse. When that is so at
    the start itself, the answer is "diverged" with an empty residual: there is nothing to improve on. So is
    it where the squares of residual or slopes are no numbers.

    Args:
        residual: whitened, priors included as rows, so that J^T J is the information.
        slopes: residual and Jacobian.
        start: parameters (P,).
        settings: when to stop.

    Raises:
        InputError: the start is not finite.
    """
    s = settings or LeastSquaresSettings()
    x = np.array(start, dtype=np.float64)
    if x.ndim != 1 or not np.isfinite(x).all():
        raise InputError(f"start {start} must be a vector of finite numbers")
    path = [x]
    try:
        r, jacobian = slopes(x)
    except SolveError:
        return _nothing(x)
    if not _usable(r, jacobian):
        return _nothing(x)
    damping, why = s.first_damping, "iteration_limit"
    for _ in range(s.max_iterations):
        gradient, curvature = jacobian.T @ r, jacobian.T @ jacobian
        if gradient @ np.linalg.pinv(curvature, hermitian=True) @ gradient <= s.small_gain:
            why = "converged"
            break
        accepted = None
        for _ in range(s.max_trials):
            step = np.linalg.solve(curvature + damping * np.diag(np.diag(curvature) + 1e-12), -gradient)
            trial = _tried(residual, x + step)
            if trial is not None and trial @ trial < r @ r:
                accepted = x + step
                break
            damping *= s.growth
        if accepted is None:
            why = "no_descent"
            break
        damping *= s.shrink
        x = accepted
        path.append(x)
        r, jacobian = slopes(x)
        if not _usable(r, jacobian):
            why = "diverged"
            break
    return LeastSquaresResult(x, r, jacobian, np.array(path), why)


def _usable(r: np.ndarray, jacobian: np.ndarray) -> bool:
    """Whether the squares, too, are numbers."""
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(np.isfinite(r @ r) and np.isfinite((jacobian**2).sum()))


def _tried(residual: Residual, x: np.ndarray) -> np.ndarray | None:
    """The residual, or None where there is none."""
    try:
        value = residual(x)
    except SolveError:
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        return value if np.isfinite(value @ value) else None


def _nothing(x: np.ndarray) -> LeastSquaresResult:
    return LeastSquaresResult(x, np.zeros(0), np.zeros((0, x.size)), x[None], "diverged")
