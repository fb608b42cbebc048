"""The actor learns the actions of the trajectory optimisation (eq. 23)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import torch
from torch import nn

from samrl_core.learning.data.fit import LOSS, Batch, Progress, fit
from samrl_core.learning.data.fit_settings import FitResult, FitSettings
from samrl_core.learning.data.samples import ACTION, IMAGE, RegressionSamples
from samrl_core.policy.networks.networks import SimActor

_MM = 1000.0  # per metre


@dataclass(frozen=True)
class Imitation:
    """Eq. 23, |a^ - a|^2, over |a|^2 + s^2 with s a share of the action limit.

    The error then counts by the action's own length down to s: a millimetre is nothing on the way, and all
    next to the goal. Figures are the error's length over all samples and over those with short actions.
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
