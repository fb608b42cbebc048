"""What the model gets wrong, from the recording itself: parameters that wander in time.

A contact whose force strays from the law would be fitted by a parameter that is not constant. So the table's
friction, and the arm's force while the blade touches, are let wander about their constants as
Ornstein-Uhlenbeck processes, anew in each push (Reichert and Mieleitner 2009, stochastic time-dependent
parameters; the residual's covariance is then that of a model with discrepancy, Kennedy and O'Hagan 2001). How
much and how slowly they wander is not set but averaged over, each possibility weighted by the probability
that it gives to the residuals of this recording. Residuals that are white leave only little wandering
possible; residuals that hang together, or pushes that disagree, widen the interval and take weight from what
disagrees. A few readings exclude little: then much of the assumed range stays, and the interval is wide.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
import torch

from samrl_core.common.errors import InputError
from samrl_core.model.physical_parameters.comparison import PushComparison
from samrl_core.model.physical_parameters.push_scene import FORCE_RATIO, TABLE_FRICTION, PushScene
from samrl_core.model.physical_parameters.sensitivity import Sensitivity


@dataclass(frozen=True)
class WanderSettings:
    """Possibilities, all equally likely before the push. ASSUMPTION: from nothing to far more than a model
    of use may have, in steps of about 2.

    Raises:
        InputError: a list is empty, a size is negative or a time is not positive.
    """

    friction: tuple[float, ...] = (0.0, 0.01, 0.02, 0.04, 0.08, 0.16)  # std of its logarithm
    force: tuple[float, ...] = (0.0, 0.005, 0.01, 0.02, 0.04, 0.08)  # of the arm's in contact, likewise
    time_s: tuple[float, ...] = (0.01, 0.03, 0.1, 0.3)  # over which they forget [s]
    bin_s: float = 0.010  # in which they are constant [s]

    def __post_init__(self) -> None:
        lists = (self.friction, self.force, self.time_s)
        if not all(lists) or min(*self.friction, *self.force) < 0 or min(*self.time_s, self.bin_s) <= 0:
            raise InputError(
                f"wander of friction {self.friction}, force {self.force} must be at least 0, times "
                f"{self.time_s} s and bin {self.bin_s} s positive, and none of the lists empty"
            )


@dataclass(frozen=True, eq=False)
class Wander:
    """What parameters and wandering are, given the recording; means and covariance over all possibilities."""

    parameters: np.ndarray  # (P,)
    covariance: np.ndarray  # (P, P)
    friction: float  # mean std of the friction's wandering [-]
    force: float  # of the arm's force in contact [-]
    time_s: float  # geometric mean of the time over which they forget [s]


@dataclass(frozen=True, eq=False)
class Responses:
    """Of the compared rows of one push to the wandering in each bin."""

    friction: np.ndarray  # (M, N)
    force: np.ndarray  # (M, N)
    time_s: np.ndarray  # (N,) of the bins


def responses(
    scene: PushScene, found: Sensitivity, rows: PushComparison, latency: float, bin_s: float
) -> Responses:
    """To the table's friction, and to the arm's force where the blade touches, bin by bin."""
    steps = torch.arange(scene.steps)
    step_s = scene.push.period_s / scene.substeps
    step_of = steps // max(1, round(bin_s / step_s))
    blade, disc = scene.coordinates, scene.coordinates + 1
    touches = found.by_state[:, blade, disc] != 0  # the blade's speed follows the disc's
    always = torch.ones_like(touches)
    friction = found.response(TABLE_FRICTION, step_of, always).numpy()
    force = found.response(FORCE_RATIO, step_of, touches).numpy()
    time_s = np.arange(int(step_of[-1]) + 1) * bin_s
    return Responses(rows.response(friction, latency), rows.response(force, latency), time_s)


def wandering(
    residual: np.ndarray,
    jacobian: np.ndarray,
    parameters: np.ndarray,
    median: np.ndarray,
    spread: np.ndarray,
    of_pushes: list[Responses],
    settings: WanderSettings,
) -> Wander:
    """Parameters and their covariance when the model may err, linearised where the fit ended.

    With residual r, Jacobian J, prior N(median, spread^2) and C = 1 + s^2 G K G^T, a possibility has the
    Gaussian posterior of generalised least squares, and weighs as much as its marginal likelihood.

    Args:
        residual: of the data in units of the noise (M,), the pushes in order.
        jacobian: (M, P).
        parameters: where that is (P,).
        median: of the prior (P,).
        spread: its standard deviations (P,).
        of_pushes: responses of each push's rows.
        settings: possibilities.
    """
    weights, means, covariances, kinds = [], [], [], []
    precision = np.diag(spread**-2.0)
    back = (median - parameters) / spread**2
    for time_s in settings.time_s:
        of_friction, of_force = (_covariance(of_pushes, name, time_s) for name in ("friction", "force"))
        for friction, force in product(settings.friction, settings.force):
            whole = np.eye(len(residual)) + friction**2 * of_friction + force**2 * of_force
            root = np.linalg.cholesky(whole)
            r, whitened_jacobian = np.linalg.solve(root, residual), np.linalg.solve(root, jacobian)
            information = whitened_jacobian.T @ whitened_jacobian + precision
            covariance = np.linalg.inv(information)
            pull = back - whitened_jacobian.T @ r
            evidence = 0.5 * (pull @ covariance @ pull - r @ r - np.linalg.slogdet(information)[1])
            weights.append(evidence - np.log(np.diag(root)).sum())
            means.append(parameters + covariance @ pull)
            covariances.append(covariance)
            kinds.append((friction, force, np.log(time_s)))
    weight = np.exp(np.array(weights) - max(weights))
    weight /= weight.sum()
    mean = weight @ np.array(means)
    apart = np.array(means) - mean
    covariance = np.einsum("k,kij->ij", weight, np.array(covariances)) + (apart.T * weight) @ apart
    friction, force, log_time = weight @ np.array(kinds)
    return Wander(mean, covariance, float(friction), float(force), float(np.exp(log_time)))


def _covariance(of_pushes: list[Responses], name: str, time_s: float) -> np.ndarray:
    """G K G^T (M, M) of one process of unit variance: none between pushes."""
    size = sum(len(getattr(one, name)) for one in of_pushes)
    whole, start = np.zeros((size, size)), 0
    for one in of_pushes:
        response = getattr(one, name)
        kernel = np.exp(-np.abs(one.time_s[:, None] - one.time_s) / time_s)
        here = slice(start, start + len(response))
        whole[here, here] = response @ kernel @ response.T
        start += len(response)
    return whole
