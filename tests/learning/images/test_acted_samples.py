"""What Q learns of actions: the expert's is worth 1, and worth falls with the distance from it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from samrl_core.common.errors import InputError
from samrl_core.learning.data.fit import ACTION, IMAGE, RETURN
from samrl_core.learning.images.acted_samples import ActedSamples, ActedSettings
from samrl_core.policy.networks.networks import SimActor
from tests.learning.tiny import LIMIT, Spots

CPU = torch.device("cpu")
EXACT = ActedSettings(exact_share=1.0)


class _Expert(SimActor):
    """Knows the answers of all its images."""

    def __init__(self, spots: Spots) -> None:
        super().__init__(LIMIT)
        self._spots = spots

    def forward(self, image: torch.Tensor) -> torch.Tensor:
        known = [(self._spots.image == one).flatten(1).all(dim=1).nonzero()[0, 0] for one in image]
        return self._spots.action[torch.stack(known)]


def test_the_experts_action_is_worth_one_and_others_less() -> None:
    spots, indices = Spots(40, 0), np.arange(40)
    batch = ActedSamples(spots, _Expert(spots), 0, EXACT).batch(indices, CPU)
    np.testing.assert_allclose(batch[RETURN], 1.0, atol=1e-6)
    settings = ActedSettings(unit=0.1, exact_share=0.0)
    noisy = ActedSamples(spots, _Expert(spots), 0, settings).batch(indices, CPU)
    error = (noisy[ACTION] - spots.action).norm(dim=1)
    assert float(error.median()) > 0.02 * LIMIT
    torch.testing.assert_close(noisy[RETURN], torch.exp(-error / (0.1 * LIMIT)))
    assert float(noisy[ACTION].norm(dim=1).max()) <= LIMIT * (1 + 1e-9)


def test_noise_follows_seed_and_indices() -> None:
    spots, actor = Spots(40, 0), SimActor(LIMIT)
    first, again, other = (ActedSamples(spots, actor, seed).batch(np.arange(8), CPU) for seed in (0, 0, 1))
    assert torch.equal(first[ACTION], again[ACTION]) and torch.equal(first[IMAGE], spots.image[:8])
    assert not torch.equal(first[ACTION], other[ACTION])
    own = actor(first[IMAGE]).detach().double()
    exact = (first[ACTION] - own).norm(dim=1) < 1e-9
    assert 0 < int(exact.sum()) < 8


@pytest.mark.parametrize("wrong", [{"unit": 0.0}, {"exact_share": 1.1}, {"noise": (0.5, 0.1)}])
def test_settings_without_meaning_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError, match=next(iter(wrong))):
        replace(ActedSettings(), **wrong)
