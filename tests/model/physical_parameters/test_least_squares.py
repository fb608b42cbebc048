"""Least squares: known minima, and each reason for stopping."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.common.errors import InputError, SolveError
from samrl_core.model.physical_parameters.least_squares import LeastSquaresSettings, least_squares


def valley(x: np.ndarray) -> np.ndarray:
    """Rosenbrock's, as residuals; zero at (1, 1)."""
    return np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]]) / 0.01


def valley_slopes(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return valley(x), np.array([[-20 * x[0], 10.0], [-1.0, 0.0]]) / 0.01


def test_follows_a_bent_valley() -> None:
    found = least_squares(valley, valley_slopes, np.array([-1.2, 1.0]))
    assert found.why_stopped == "converged"
    np.testing.assert_allclose(found.parameters, 1.0, atol=1e-3)
    assert len(found.path) > 3 and np.all(found.path[0] == [-1.2, 1.0])


def test_says_when_it_ran_out() -> None:
    settings = LeastSquaresSettings(max_iterations=2)
    found = least_squares(valley, valley_slopes, np.array([-1.2, 1.0]), settings)
    assert found.why_stopped == "iteration_limit" and len(found.path) == 3


def test_walks_around_what_cannot_be_solved() -> None:
    """Beyond x = 1.5 the model fails; the minimum before it is found all the same."""

    def residual(x: np.ndarray) -> np.ndarray:
        if x[0] > 1.5:
            raise SolveError("no solution")
        return np.array([100 * (x[0] - 1.0) + 60 * (x[0] - 1.0) ** 3])

    def jacobian(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return residual(x), np.array([[100 + 180 * (x[0] - 1.0) ** 2]])

    found = least_squares(residual, jacobian, np.array([-3.0]))
    assert found.why_stopped == "converged"
    assert found.parameters[0] == pytest.approx(1.0, abs=1e-3)


def test_a_slope_that_lies_finds_no_descent() -> None:
    found = least_squares(lambda x: x + 5.0, lambda x: (x + 5.0, -np.eye(1)), np.array([1.0]))
    assert found.why_stopped == "no_descent"
    assert found.parameters[0] == 1.0


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_start_without_a_residual_is_divergence(value: float) -> None:
    found = least_squares(lambda x: x, lambda x: (np.array([value]), np.eye(1)), np.zeros(1))
    assert found.why_stopped == "diverged" and not len(found.residual)


def test_a_start_that_cannot_be_solved_is_divergence() -> None:
    def jacobian(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        raise SolveError("no solution")

    assert least_squares(lambda x: x, jacobian, np.zeros(1)).why_stopped == "diverged"


def test_a_start_that_is_no_number_is_refused() -> None:
    with pytest.raises(InputError, match="finite"):
        least_squares(valley, valley_slopes, np.array([np.nan, 0.0]))
