"""Tolerances are factored block by block; the whole matrix gives the same."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.tolerances import recording_columns, tolerance_columns
from tests.diagnosis import worlds


def test_blocks_give_what_the_whole_matrix_gives() -> None:
    trials = worlds.trials([*worlds.world(11, "D"), *worlds.world(12, "A")])
    likelihood = Likelihood(trials)
    shared = len(tolerance_columns(trials[0]))
    own = np.concatenate([[0], np.cumsum([len(recording_columns(trial)) for trial in trials])])
    whole = np.zeros((len(likelihood.y), shared + int(own[-1])))
    for r, trial in enumerate(trials):
        stated = [*enumerate(tolerance_columns(trial)), *enumerate(recording_columns(trial), shared + own[r])]
        for k, (columns, std) in stated:
            for (channel, j), rows in columns.items():
                scaled = std * rows[0] / trial.sigma[channel][:, j]
                color = trial.color.get(channel)
                white = scaled if color is None else color.whitened(scaled, j)
                whole[likelihood.blocks[r, channel, j], k] = white
    gram = whole.T @ whole
    np.testing.assert_allclose(likelihood.tolerance_gram(), gram, atol=1e-9 * gram.max())
    sizes = np.random.default_rng(0).normal(size=len(gram))
    made = whole @ sizes
    np.testing.assert_allclose(likelihood.of_tolerances(sizes), made, atol=1e-4 * np.abs(made).max())
