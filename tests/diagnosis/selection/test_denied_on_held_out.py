"""Held-out recordings deny a further effect beyond their noise, and a right one hardly ever."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.diagnosis.selection.on_held_out import are_denied
from samrl_core.diagnosis.selection.settings import SelectionSettings

LEAST = SelectionSettings().held_out_share


@pytest.mark.parametrize("expected", [9.0, 20.0, 43.0, 200.0])
def test_a_right_prediction_is_hardly_ever_denied(expected: float) -> None:
    """A log likelihood ratio of a right one is Gaussian, its variance twice its mean."""
    rng = np.random.default_rng(0)
    won = expected + np.sqrt(2.0 * expected) * rng.standard_normal(4000)
    assert np.mean([are_denied(w, expected, LEAST) for w in won]) < 0.03


@pytest.mark.parametrize("expected", [20.0, 43.0, 200.0])
def test_one_that_acts_nowhere_else_is_denied(expected: float) -> None:
    """What was fitted to noise alone loses on other recordings what it should win."""
    rng = np.random.default_rng(0)
    won = -expected + np.sqrt(2.0 * expected) * rng.standard_normal(400)
    assert np.mean([are_denied(w, expected, LEAST) for w in won]) > 0.99


@pytest.mark.parametrize(
    ("won", "expected", "denied"), [(2.4, 43.0, True), (31.2, 29.8, False), (2.0, 7.0, False)]
)
def test_as_worlds_have_it(won: float, expected: float, denied: bool) -> None:
    """A torque scale that mends a servo's gain; a payload beside an encoder's offset; too little to say."""
    assert are_denied(won, expected, LEAST) == denied
