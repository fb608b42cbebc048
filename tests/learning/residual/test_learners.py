"""Every learner by name: zero before training, repeatable, the same after a restart."""

from __future__ import annotations

import math
from dataclasses import dataclass

import pytest
import torch

from samrl_core.common.errors import InputError
from samrl_core.learning.residual.learner import Learner
from samrl_core.learning.residual.learners import (
    DEFAULT_LEARNER,
    LEARNERS,
    create_learner,
    create_settings,
    name_of,
    settings_from_json,
    settings_to_json,
)
from samrl_core.learning.residual.transitions import Batch
from samrl_core.policy.networks.network_image import CHANNELS
from samrl_core.policy.networks.networks import FEATURES, Encoder

ENCODER = Encoder(CHANNELS, torch.Generator().manual_seed(3))
every_learner = pytest.mark.parametrize("name", list(LEARNERS))


def sample_batch(size: int, generator: torch.Generator) -> Batch:
    """Transitions of nothing real; about half of them end in success."""

    def features() -> torch.Tensor:
        return torch.rand(size, FEATURES, generator=generator)

    def vectors() -> torch.Tensor:
        return 0.001 * torch.randn(size, 3, generator=generator)

    reward = torch.randint(2, (size,), generator=generator).float()
    return Batch(features(), vectors(), vectors(), reward, 0.9 * (1 - reward), features(), vectors(), 50)


def create(name: str, seed: int = 0) -> Learner:
    return create_learner(create_settings(name, batch_size=8), ENCODER, seed)


def hold_to_the_protocol(name: str) -> None:
    """What every learner must do; the recipe's toy learner is held to it as well."""
    learner = create(name)
    features, nominal = torch.rand(4, FEATURES), torch.rand(4, 3) * 0.01
    assert not learner.actor.mean_of_features(features, nominal).any() and learner.updates == 0
    again, other = create(name), create(name, seed=1)
    for k in range(4):
        metrics = learner.update(sample_batch)
        assert tuple(metrics) == learner.METRICS and not any(math.isinf(v) for v in metrics.values())
        again.update(sample_batch)
        other.update(sample_batch)
        assert learner.updates == k + 1
    assert _equal(learner.state(), again.state()) and not _equal(learner.state(), other.state())
    assert learner.actor.mean_of_features(features, nominal).norm(dim=1).max() <= learner.actor.limit
    restored = create(name, seed=2)
    restored.load_state({key: value.clone() for key, value in learner.state().items()})
    learner.update(sample_batch)
    restored.update(sample_batch)
    assert _equal(learner.state(), restored.state())
    with torch.no_grad():
        one, two = (who.actor.mean_of_features(features, nominal) for who in (learner, restored))
    assert torch.equal(one, two)
    with pytest.raises(InputError, match="no state of this learner"):
        create(name).load_state({})
    settings = create_settings(name, batch_size=8)
    assert settings_from_json(settings_to_json(settings)) == settings and name_of(settings) == name


@every_learner
def test_every_learner_keeps_to_the_protocol(name: str) -> None:
    hold_to_the_protocol(name)


def test_unknown_learners_and_settings_are_refused() -> None:
    assert DEFAULT_LEARNER in LEARNERS
    with pytest.raises(InputError, match="learner is 'luck', must be one of: td3"):
        create_settings("luck")

    @dataclass(frozen=True)
    class Strange:
        limit: float = 0.1
        batch_size: int = 1
        gamma: float = 1.0
        n_step: int = 1

    with pytest.raises(InputError, match="no learner has settings Strange"):
        name_of(Strange())


def _equal(a: dict[str, torch.Tensor], b: dict[str, torch.Tensor]) -> bool:
    return a.keys() == b.keys() and all(torch.equal(a[key], b[key]) for key in a)
