"""What the actor does on images of labelled states, and how much that is worth.

A success that is discounted by the actions until then hardly depends on where one image was taken from: the
next one puts the action right. Over an episode with its view held it does, but that is one number for a
whole row of images. Here each image has its own: what the actor's action there loses against the expert's,

    R = exp(-|a - a*| / unit),

a return discounted by what it takes to make the difference good, relative to the expert's own from there: 1
for the expert's action in any state, so that only view and action make a difference. It is the paper's
prediction error (eq. 23) on the scale of a return; the regression is that of eq. 24.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from samrl_core.common.errors import InputError
from samrl_core.learning.data.fit import ACTION, IMAGE, RETURN, RegressionSamples
from samrl_core.learning.images.rendered_samples import rng_of
from samrl_core.policy.networks.networks import SimActor


@dataclass(frozen=True)
class ActedSettings:
    """How actions vary about the actor's, and how fast their worth falls. ASSUMPTIONS."""

    unit: float = 0.1  # error at which the worth is 1/e [action limits]
    exact_share: float = 0.8  # of actions that are the actor's own
    noise: tuple[float, float] = (0.02, 0.5)  # of the others, per axis, standard deviation [action limits]

    def __post_init__(self) -> None:
        if not 0.0 < self.unit < np.inf or not 0.0 <= self.exact_share <= 1.0:
            raise InputError(
                f"unit {self.unit} must be above 0 and finite, exact_share {self.exact_share} within 0..1"
            )
        if not 0.0 < self.noise[0] <= self.noise[1]:
            raise InputError(f"noise is {self.noise}, must be two positive numbers, the smaller first")


class ActedSamples:
    """`RegressionSamples` for Q: the actor's action in place of the expert's, and its worth."""

    def __init__(
        self, samples: RegressionSamples, actor: SimActor, seed: int, settings: ActedSettings | None = None
    ) -> None:
        """Remembers both.

        Args:
            samples: images with the expert's actions.
            actor: acts on them, where they are.
            seed: of the noise on its actions.
            settings: of noise and worth.
        """
        self._samples, self._actor, self._seed = samples, actor, seed
        self._settings = settings or ActedSettings()

    def __len__(self) -> int:
        return len(self._samples)

    def batch(self, indices: np.ndarray, device: torch.device) -> dict[str, torch.Tensor]:
        """See `RegressionSamples`."""
        s, limit = self._settings, self._actor.action_limit
        batch = self._samples.batch(indices, device)
        rng = rng_of(self._seed, np.asarray(indices, dtype=np.int64))
        count = len(indices)
        low, high = np.log(s.noise)
        size = np.exp(rng.uniform(low, high, (count, 1))) * (rng.random((count, 1)) >= s.exact_share)
        noise = torch.from_numpy(limit * size * rng.standard_normal((count, 3)))
        self._actor.to(device).eval()
        with torch.no_grad():
            action = self._actor(batch[IMAGE]).double() + noise.to(device)
        length = action.norm(dim=1, keepdim=True)
        action = action * (limit / length.clamp_min(1e-12)).clamp_max(1.0)
        error = (action - batch[ACTION].to(action)).norm(dim=1)
        return {**batch, ACTION: action, RETURN: torch.exp(-error / (s.unit * limit))}
