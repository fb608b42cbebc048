"""The sensing-aware Q learns the returns that followed an action seen from a view (eq. 24)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import torch
from torch import nn
from torch.nn import functional

from samrl_core.learning.data.fit import LOSS, Batch, Objective, Progress, fit
from samrl_core.learning.data.fit_settings import FitResult, FitSettings
from samrl_core.learning.data.samples import ACTION, IMAGE, RETURN, RegressionSamples
from samrl_core.policy.networks.networks import SensingQ

EXPLAINED = "explained"  # share of the returns' variance that Q accounts for; 0 is as good as a constant


def squared_error(network: nn.Module, batch: Batch) -> dict[str, torch.Tensor]:
    """Eq. 24, (Q - R)^2 per sample (B,); see `_figures`."""
    wanted = batch[RETURN].float()
    q = network(batch[IMAGE], batch[ACTION].float())
    return {LOSS: (q - wanted).square(), **_figures(q, wanted)}


def likelihood(network: nn.Module, batch: Batch) -> dict[str, torch.Tensor]:
    """Cross entropy of Q and R per sample (B,), R taken for the chance of a success; see `_figures`.

    Its best Q is that of eq. 24, the mean of R. What differs is the way there: the squared error of a Q that
    says 0 of everything has a vanishing gradient, and where most returns are small a Q can end up there.
    """
    assert isinstance(network, SensingQ)
    wanted = batch[RETURN].float()
    logit = network.logit(batch[IMAGE], batch[ACTION].float())
    loss = functional.binary_cross_entropy_with_logits(logit, wanted, reduction="none")
    return {LOSS: loss, **_figures(torch.sigmoid(logit), wanted)}


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


def _figures(q: torch.Tensor, wanted: torch.Tensor) -> dict[str, torch.Tensor]:
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
