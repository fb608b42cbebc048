"""The sensing-aware Q learns the returns that followed an action seen from a view (eq. 24)."""

from __future__ import annotations

from pathlib import Path

import torch
from torch import nn

from samrl_core.learn.fit import LOSS, Batch, Progress, fit
from samrl_core.learn.fit_settings import FitResult, FitSettings
from samrl_core.learn.networks import SensingQ
from samrl_core.learn.samples import ACTION, IMAGE, RETURN, Samples


def value_regression(network: nn.Module, batch: Batch) -> dict[str, torch.Tensor]:
    """Eq. 24, (Q - R)^2 per sample (B,); figures are the error's size, for all and by the return's half."""
    wanted = batch[RETURN].float()
    difference = network(batch[IMAGE], batch[ACTION].float()) - wanted
    error = difference.detach().abs()
    return {
        LOSS: difference.square(),
        "error": error,
        "error_where_low": error.where(wanted < 0.5, torch.nan),
        "error_where_high": error.where(wanted >= 0.5, torch.nan),
    }


def fit_q(
    train: Samples,
    validation: Samples,
    settings: FitSettings,
    folder: Path,
    progress: Progress | None = None,
) -> tuple[SensingQ, FitResult]:
    """Train a Q from nothing, or from the checkpoint in `folder`; errors as in `fit`."""
    network = SensingQ(torch.Generator().manual_seed(settings.seed))
    return network, fit(network, train, validation, value_regression, settings, folder, progress)
