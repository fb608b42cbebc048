"""Regressions of Learn@Sim: the actor on expert actions (eq. 23), the sensing-aware Q on returns (eq. 24)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import torch
from torch import nn
from torch.nn import functional

from samrl_core.learning.data.fit import (
    ACTION,
    IMAGE,
    LOSS,
    RETURN,
    Batch,
    FitResult,
    FitSettings,
    Objective,
    Progress,
    RegressionSamples,
    fit,
)
from samrl_core.policy.networks.networks import SensingQ, SimActor

_MM = 1000.0  # per metre


@dataclass(frozen=True)
class Imitation:
    """Eq. 23, |a^ - a|^2, over |a|^2 + s^2 with s a share of the action limit.

    The error then counts by the action's own length down to s: a millimetre is nothing on the way, and all
    next to the goal. Metrics are the error's length over all samples and over those with short actions.
    """

    action_limit: float  # [m]
    floor: float = 0.1  # s, as a share of the limit; an error much below it is not worth more
    near: float = 0.3  # actions up to this share of the limit count as near the goal

    def __call__(self, network: nn.Module, batch: Batch) -> dict[str, torch.Tensor]:
        """Values per sample (B,)."""
        wanted = batch[ACTION].float()
        squared = (network(batch[IMAGE]) - wanted).square().sum(dim=1)
        length = wanted.norm(dim=1)
        error = squared.detach().sqrt() * _MM
        return {
            LOSS: squared / (length.square() + (self.floor * self.action_limit) ** 2),
            "error_mm": error,
            "near_error_mm": error.where(length < self.near * self.action_limit, torch.nan),
        }


def fit_actor(
    train: RegressionSamples,
    validation: RegressionSamples,
    action_limit: float,
    settings: FitSettings,
    folder: Path,
    progress: Progress | None = None,
) -> tuple[SimActor, FitResult]:
    """Train an actor from nothing, or from the checkpoint in `folder`; errors as in `fit`."""
    actor = SimActor(action_limit, torch.Generator().manual_seed(settings.seed))
    result = fit(actor, train, validation, Imitation(action_limit), settings, folder, progress)
    return actor, result


EXPLAINED = "explained"  # share of the returns' variance that Q accounts for; 0 is as good as a constant


def squared_error(network: nn.Module, batch: Batch) -> dict[str, torch.Tensor]:
    """Eq. 24, (Q - R)^2 per sample (B,); see `_error_metrics`."""
    wanted = batch[RETURN].float()
    q = network(batch[IMAGE], batch[ACTION].float())
    return {LOSS: (q - wanted).square(), **_error_metrics(q, wanted)}


def likelihood(network: nn.Module, batch: Batch) -> dict[str, torch.Tensor]:
    """Cross entropy of Q and R per sample (B,), R taken for the chance of a success; see `_error_metrics`.

    Its best Q is that of eq. 24, the mean of R. What differs is the way there: the squared error of a Q that
    is 0 everywhere has a vanishing gradient, and where most returns are small a Q can end up there.
    """
    assert isinstance(network, SensingQ)
    wanted = batch[RETURN].float()
    logit = network.logit(batch[IMAGE], batch[ACTION].float())
    loss = functional.binary_cross_entropy_with_logits(logit, wanted, reduction="none")
    return {LOSS: loss, **_error_metrics(torch.sigmoid(logit), wanted)}


Q_LOSSES: dict[str, Objective] = {"square": squared_error, "likelihood": likelihood}


def fit_q(
    train: RegressionSamples,
    validation: RegressionSamples,
    settings: FitSettings,
    folder: Path,
    progress: Progress | None = None,
    loss: str = "square",
) -> tuple[SensingQ, FitResult]:
    """Train a Q from nothing, or from the checkpoint in `folder`, by a `Q_LOSSES`; errors as in `fit`."""
    network = SensingQ(torch.Generator().manual_seed(settings.seed))
    result = fit(network, train, validation, Q_LOSSES[loss], settings, folder, progress)
    figures = dict(result.figures)
    variance = figures.pop("return_square") - figures.pop("return") ** 2
    figures[EXPLAINED] = 1.0 - figures.pop("square") / max(variance, 1e-12)
    return network, replace(result, figures=figures)


def _error_metrics(q: torch.Tensor, wanted: torch.Tensor) -> dict[str, torch.Tensor]:
    """The error's size, for all and by the return's half, and what `EXPLAINED` is made of."""
    difference = q.detach() - wanted
    error = difference.abs()
    return {
        "error": error,
        "error_where_low": error.where(wanted < 0.5, torch.nan),
        "error_where_high": error.where(wanted >= 0.5, torch.nan),
        "square": difference.square(),
        "return": wanted,
        "return_square": wanted.square(),
    }
