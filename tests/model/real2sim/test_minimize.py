"""The minimiser: convergence on a problem with kinks, bounds, divergence, refusals."""

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_core.model.real2sim.minimize import MinimizeSettings, minimize

FREE = np.full(3, np.inf)
SCALE = np.array([0.03, 0.03, 0.3])
TARGET = np.array([0.041, -0.037, 0.4])


def absolute(x: np.ndarray) -> tuple[float, np.ndarray]:
    """A sum of absolute values, coupled between the first two parameters."""
    mix = np.array([[1.0, 0.4, 0.0], [-0.3, 1.0, 0.0], [0.0, 0.0, 0.2]])
    r = mix @ (x - TARGET)
    return float(np.abs(r).sum()), mix.T @ np.sign(r)


def test_kinked_problem_within_forty_evaluations() -> None:
    """From the centre of a 10 cm range to 0.2 mm."""
    found = minimize(absolute, np.zeros(3), SCALE, -FREE, FREE, MinimizeSettings(first_step=0.3))
    assert found.evaluations <= 40
    assert np.abs(found.parameters - TARGET)[:2].max() < 2e-4
    assert found.value < found.first_value


def test_stops_by_itself_and_repeats() -> None:
    """Given room it says converged, with the same bits each time."""
    settings = MinimizeSettings(max_evaluations=200)
    runs = [minimize(absolute, np.zeros(3), SCALE, -FREE, FREE, settings) for _ in range(2)]
    assert runs[0].why_stopped == "converged" and runs[0].evaluations < 200
    np.testing.assert_array_equal(runs[0].parameters, runs[1].parameters)


def test_says_when_it_ran_out() -> None:
    """Three evaluations are too few."""
    found = minimize(absolute, np.zeros(3), SCALE, -FREE, FREE, MinimizeSettings(max_evaluations=3))
    assert (found.why_stopped, found.evaluations) == ("iteration_limit", 3)


def test_bounds_hold() -> None:
    """The minimum lies outside: the answer is on the bound and counts as converged."""
    upper = np.array([0.02, 1.0, 1.0])
    seen = []

    def watched(x: np.ndarray) -> tuple[float, np.ndarray]:
        seen.append(x.copy())
        return absolute(x)

    found = minimize(watched, np.zeros(3), SCALE, -FREE, upper, MinimizeSettings(max_evaluations=100))
    assert np.all(np.array(seen) <= upper)
    assert found.parameters[0] == pytest.approx(0.02)
    assert found.why_stopped == "converged"


@pytest.mark.parametrize("where", ["value", "gradient"])
def test_non_finite_objective_keeps_last_good(where: str) -> None:
    """After the third evaluation the objective breaks."""
    calls = []

    def breaks(x: np.ndarray) -> tuple[float, np.ndarray]:
        calls.append(x.copy())
        value, gradient = absolute(x)
        if len(calls) == 4:
            return (np.nan, gradient) if where == "value" else (value - 1e9, gradient * np.inf)
        return value, gradient

    found = minimize(breaks, np.zeros(3), SCALE, -FREE, FREE, MinimizeSettings())
    assert found.why_stopped == "diverged"
    assert np.isfinite(found.parameters).all()
    np.testing.assert_array_equal(found.parameters, calls[2])


def test_refuses_bad_problems() -> None:
    """Shapes, scales, bounds and starts are checked."""
    for start, scale, lower, upper in (
        (np.zeros(2), SCALE, -FREE, FREE),
        (np.zeros(3), 0 * SCALE, -FREE, FREE),
        (np.zeros(3), SCALE, FREE, -FREE),
        (np.array([0.0, np.nan, 0.0]), SCALE, -FREE, FREE),
    ):
        with pytest.raises(InputError):
            minimize(absolute, start, scale, lower, upper, MinimizeSettings())
