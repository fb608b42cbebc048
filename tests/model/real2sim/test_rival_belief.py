"""Two beliefs weighed by an image: against the evidence of a linear measurement in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.common.errors import InputError
from samrl_core.model.model import Model
from samrl_core.model.real2sim.real2sim import Estimate, initial_estimate
from samrl_core.model.real2sim.rival_belief import log_evidence_ratio


@pytest.fixture(scope="module")
def narrow() -> Estimate:
    """What is believed of the hard thread in a calibrated cell."""
    return initial_estimate(Model(task_named("needle_threading_hard"), cell_named()))


def wider(narrow: Estimate, times: float = 2.4) -> Estimate:
    """The last four numbers, length and camera, known so many times worse."""
    factor = np.where(np.arange(27) >= 23, times, 1.0)
    return replace(narrow, covariance=narrow.covariance * np.outer(factor, factor))


@pytest.mark.parametrize("seed", range(5))
def test_the_ratio_is_that_of_the_evidences(narrow: Estimate, seed: int) -> None:
    """Of a measurement of twelve numbers that all 27 values act on."""
    rng = np.random.default_rng(seed)
    wide = wider(narrow)
    scale = np.sqrt(np.diag(narrow.covariance))
    matrix, noise = rng.standard_normal((12, 27)) / scale, 0.5 * np.eye(12)
    seen = matrix @ (wide.values + 3.0 * scale * rng.standard_normal(27))
    precision = np.linalg.inv(wide.covariance) + matrix.T @ np.linalg.solve(noise, matrix)
    covariance = np.linalg.inv(precision)
    found = covariance @ matrix.T @ np.linalg.solve(noise, seen - matrix @ wide.values)
    posterior = replace(wide, values=wide.values + found, covariance=covariance)
    narrow_seen, wide_seen = (
        multivariate_normal(matrix @ one.values, matrix @ one.covariance @ matrix.T + noise).logpdf(seen)
        for one in (narrow, wide)
    )
    ratio = log_evidence_ratio(narrow, wide, posterior)
    assert ratio == pytest.approx(float(narrow_seen - wide_seen), rel=1e-6, abs=1e-6)


def test_beliefs_that_do_not_differ_have_the_same_evidence(narrow: Estimate) -> None:
    assert log_evidence_ratio(narrow, narrow, narrow) == 0.0


def test_what_is_known_better_by_the_wider_belief_is_refused(narrow: Estimate) -> None:
    with pytest.raises(InputError, match="camera_z.*known better in every direction"):
        log_evidence_ratio(narrow, wider(narrow, 0.5), narrow)


def test_beliefs_about_other_values_are_refused(narrow: Estimate) -> None:
    with pytest.raises(InputError, match="about the same values"):
        log_evidence_ratio(narrow, replace(wider(narrow), values=narrow.values + 1.0), narrow)
