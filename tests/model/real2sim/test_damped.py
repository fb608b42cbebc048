"""Damped Newton steps: a coupled problem with kinks, bounds, divergence, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from samrl_core.common.errors import InputError
from samrl_core.model.real2sim.damped import DampedSettings, Local, minimize_damped

FREE = np.full(4, np.inf)
SCALE = np.array([0.1, 0.1, 1.0, 1.0])
RNG = np.random.default_rng(0)
MIX = RNG.normal(size=(30, 4))
MIX[:, 1] = MIX[:, 0] + 0.05 * MIX[:, 1]  # two parameters do almost the same
WANTED = MIX @ [0.15, -0.1, 1.2, 0.7] + RNG.standard_t(1.5, 30) * 0.05  # some far off


def absolute(x: np.ndarray) -> Local:
    """A sum of absolute residuals, with the curvature of iterated least squares."""
    r = MIX @ x - WANTED
    weight = 1.0 / np.maximum(np.abs(r), 1e-4)
    return Local(float(np.abs(r).sum()), MIX.T @ np.sign(r), (MIX.T * weight) @ MIX)


def least() -> float:
    """The least value, by linear programming."""
    eye = np.eye(30)
    rows = np.block([[MIX, -eye], [-MIX, -eye]])
    cost = np.concatenate([np.zeros(4), np.ones(30)])
    bounds = [(None, None)] * 4 + [(0, None)] * 30
    return float(linprog(cost, rows, np.concatenate([WANTED, -WANTED]), bounds=bounds).fun)


def test_coupled_problem_within_thirty_evaluations() -> None:
    """To one per cent of the least value."""
    found = minimize_damped(absolute, np.zeros(4), SCALE, -FREE, FREE, DampedSettings(max_evaluations=30))
    assert found.value < 1.01 * least() and found.value < 0.3 * found.first_value


def test_never_goes_up_and_says_why_it_stopped() -> None:
    """What is watched is the best so far; room to spare ends with "converged", three evaluations do not."""
    seen = []
    settings = DampedSettings(max_evaluations=200)
    found = minimize_damped(absolute, np.zeros(4), SCALE, -FREE, FREE, settings, seen.append)
    values = [absolute(x).value for x in seen]
    assert (np.diff(values) <= 0).all() and len(seen) <= found.evaluations
    assert found.why_stopped == "converged" and found.evaluations < 200
    short = minimize_damped(absolute, np.zeros(4), SCALE, -FREE, FREE, DampedSettings(max_evaluations=3))
    assert (short.why_stopped, short.evaluations) == ("iteration_limit", 3)


def test_bounds_hold() -> None:
    """The minimum lies outside: the answer is on the bound."""
    upper = np.array([2.0, 2.0, 0.5, 2.0])
    seen = []

    def watched(x: np.ndarray) -> Local:
        seen.append(x)
        return absolute(x)

    found = minimize_damped(watched, np.zeros(4), SCALE, -FREE, upper, DampedSettings(max_evaluations=60))
    assert np.all(np.array(seen) <= upper)
    assert found.parameters[2] == pytest.approx(0.5)


def test_a_parameter_that_nothing_pulls_at_stays() -> None:
    """Its slope and curvature are zero: it must not run away."""

    def blind(x: np.ndarray) -> Local:
        there = absolute(np.array([*x[:3], 0.7]))
        keep = np.array([1.0, 1.0, 1.0, 0.0])
        return Local(there.value, there.gradient * keep, there.curvature * np.outer(keep, keep))

    found = minimize_damped(blind, np.zeros(4), SCALE, -FREE, FREE, DampedSettings())
    assert found.parameters[3] == 0.0 and found.value < 0.5 * found.first_value


@pytest.mark.parametrize("where", ["value", "gradient", "curvature"])
def test_what_is_not_finite_keeps_the_last_good(where: str) -> None:
    """After the second evaluation the objective breaks."""
    calls = []

    def breaks(x: np.ndarray) -> Local:
        calls.append(x)
        there = absolute(x)
        if len(calls) < 3:
            return there
        parts = {"value": there.value, "gradient": there.gradient, "curvature": there.curvature}
        parts[where] = parts[where] * np.nan
        return Local(**parts)

    found = minimize_damped(breaks, np.zeros(4), SCALE, -FREE, FREE, DampedSettings())
    assert found.why_stopped == "diverged"
    assert any(np.array_equal(found.parameters, x) for x in calls[:2])


def test_refuses_bad_problems() -> None:
    """Shapes, scales, bounds and starts are checked."""
    for start, scale, lower, upper in (
        (np.zeros(2), SCALE, -FREE, FREE),
        (np.zeros(4), 0 * SCALE, -FREE, FREE),
        (np.zeros(4), SCALE, FREE, -FREE),
        (np.array([0.0, np.nan, 0.0, 0.0]), SCALE, -FREE, FREE),
    ):
        with pytest.raises(InputError):
            minimize_damped(absolute, start, scale, lower, upper, DampedSettings())
