"""Simulations without an effect are logged as the recordings are: else their threshold is of others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.diagnosis.selection.null_simulations import sample_plant, simulate_null_recordings
from tests.diagnosis import worlds


@pytest.mark.parametrize("logs_speed", [True, False])
def test_a_speed_that_nobody_logs_is_not_exact_in_a_null_simulation(logs_speed: bool) -> None:
    (recording,) = worlds.record(worlds.plant(), "A", np.random.default_rng(1), 2.0)
    if not logs_speed:
        recording = replace(recording, states=replace(recording.states, velocity=None))
    trials = worlds.trials([recording])
    rng = np.random.default_rng(2)
    made = simulate_null_recordings(trials, sample_plant(trials[0], rng), rng)
    assert made is not None
    (null,) = worlds.trials(made)
    assert (null.motion.raw_velocity is not None) == logs_speed
    assert null.channels == trials[0].channels
    found, expected = null.motion.velocity_noise(), trials[0].motion.velocity_noise()
    assert found == pytest.approx(expected, rel=0.3)
