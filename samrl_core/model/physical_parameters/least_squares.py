"""Nonlinear least squares by SciPy, stopped by the data's information, with the reason for stopping."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.optimize

from samrl_core.common.errors import InputError, SolveError

Residual = Callable[[np.ndarray], np.ndarray]  # parameters (P,) -> whitened residual (M,)
ResidualAndJacobian = Callable[
    [np.ndarray], tuple[np.ndarray, np.ndarray]
]  # -> the same, and its Jacobian (M, P)


@dataclass(frozen=True)
class LeastSquaresSettings:
    """When to stop."""

    max_iterations: int = 30
    # Converged when the squared residual would decrease by no more: a step of a tenth of a standard
    # deviation.
    least_decrease: float = 0.01
    small_step: float = 1e-6  # no descent: the trust region is below this share of the parameters' norm


@dataclass(frozen=True, eq=False)
class LeastSquaresResult:
    """The best point met."""

    parameters: np.ndarray  # (P,)
    residual: np.ndarray  # (M,) there
    jacobian: np.ndarray  # (M, P) there
    path: np.ndarray  # (K + 1, P) accepted points, the start first
    why_stopped: str  # converged | iteration_limit | no_descent | diverged


class _Stopped(Exception):
    """Ends SciPy's iteration with a reason."""


def least_squares(
    residual: Residual,
    residual_and_jacobian: ResidualAndJacobian,
    start: np.ndarray,
    settings: LeastSquaresSettings | None = None,
) -> LeastSquaresResult:
    """Minimise the squared residual by SciPy's trust region method, scaled by the Jacobian's columns.

    A trial point where the model cannot be solved, or gives no number, counts as worse. When that is so at
    the start itself, the answer is "diverged" with an empty residual: there is nothing to improve on. So is
    it where the squares of residual or Jacobian are not finite.

    Args:
        residual: whitened, priors included as rows, so that J^T J is the information.
        residual_and_jacobian: both, at parameters (P,).
        start: parameters (P,).
        settings: when to stop.

    Raises:
        InputError: the start is not finite.
    """
    s = settings or LeastSquaresSettings()
    x = np.array(start, dtype=np.float64)
    if x.ndim != 1 or not np.isfinite(x).all():
        raise InputError(f"start {start} must be a vector of finite numbers")
    try:
        r, jacobian = residual_and_jacobian(x)
    except SolveError:
        return _nothing(x)
    if not _usable(r, jacobian):
        return _nothing(x)
    path, here = [x], (r, jacobian)

    def tried(x: np.ndarray) -> np.ndarray:
        if np.array_equal(x, path[-1]):
            return here[0]
        try:
            value = residual(x)
        except SolveError:
            return np.full(len(r), np.inf)
        with np.errstate(over="ignore", invalid="ignore"):
            return value if np.isfinite(value @ value) else np.full(len(r), np.inf)

    def accepted(x: np.ndarray) -> np.ndarray:
        """The Jacobian; SciPy asks for it at the start and wherever a step was accepted."""
        nonlocal here
        if not np.array_equal(x, path[-1]):
            path.append(x.copy())
            here = residual_and_jacobian(x)
        if not _usable(*here):
            raise _Stopped("diverged")
        gradient = here[1].T @ here[0]
        if gradient @ np.linalg.pinv(here[1].T @ here[1], hermitian=True) @ gradient <= s.least_decrease:
            raise _Stopped("converged")
        if len(path) > s.max_iterations:
            raise _Stopped("iteration_limit")
        return here[1]

    solve: Any = scipy.optimize.least_squares  # its stubs know neither a function as Jacobian nor None
    try:
        solve(tried, x, accepted, x_scale="jac", ftol=None, gtol=None, xtol=s.small_step)
        why = "no_descent"
    except _Stopped as reason:
        why = str(reason)
    return LeastSquaresResult(path[-1], *here, np.array(path), why)


def _usable(r: np.ndarray, jacobian: np.ndarray) -> bool:
    """Whether the squares, too, are numbers."""
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(np.isfinite(r @ r) and np.isfinite((jacobian**2).sum()))


def _nothing(x: np.ndarray) -> LeastSquaresResult:
    return LeastSquaresResult(x, np.zeros(0), np.zeros((0, x.size)), x[None], "diverged")
