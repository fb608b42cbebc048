"""The residual policy (eqs. 13-16): TD3 (Fujimoto et al. 2018) on the real image and the nominal action.

What differs from plain TD3, and why: the actor's last layer starts at zero, so that the first policy is the
model's (eq. 15); actions are bounded in length; returns run over 100 actions, as a rule to the end of the
episode, where the only reward comes; the target stays within 0..1, where every return of eq. 16 lies; critics
learn alone at first, because the actor would climb what they have not yet learnt; and it is held to the
residuals that were tried (Fujimoto & Gu 2021, "A minimalist approach to offline RL"), as beyond them critics
make things up; the less, the more episodes there are, for the error of what critics say of a way to go falls
with the root of their number. At the full price forever, no residual comes far from where it began.

The encoder is the nominal policy's and stands still, so that what is learnt from are features: 128 numbers a
step. With convolutions of their own, actor and critics knew a few dozen episodes by heart, and an update took
3.6 s of one core (batch of 64), where a real cell has a core to spare at most. Even the features tell each
episode from every other. So an update sees few of them, drawn anew for each step (dropout; Srivastava et al.
2014), and more of them the more episodes there are: a regression wants several events per variable (Peduzzi
et al. 1996). Residuals, which explore with a memory, tell episodes too: critics learn from noisy ones.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import nn
from torch.nn import functional

from samrl_core.common.errors import InputError, SolveError
from samrl_core.learning.data.checkpoint import adam_tensors, load_adam, with_prefix
from samrl_core.learning.residual.transitions import Batch
from samrl_core.policy.networks.networks import FEATURES, Encoder, ResidualActor, TwinCritic, thinned


@dataclass(frozen=True)
class ResidualSettings:
    """Settings of the learner.

    Raises:
        InputError: a value outside its limits.
    """

    limit: float = 0.003  # longest residual, ASSUMPTION: above what updated models err by [m]
    gamma: float = 0.97  # per action: half of the reward is left after 23
    n_step: int = 100  # actions until a return goes on from a critic: most episodes are over before
    batch: int = 256  # transitions per update
    critic_rate: float = 3e-4  # of Adam
    actor_rate: float = 6e-5
    episodes_per_feature: float = 4.0  # in the replay, for each feature that an update sees in a step
    blur: float = 0.1  # noise on the residuals that critics learn from, per axis, of the limit
    average: float = 0.01  # share of the new weights in the targets, per update of the actor
    target_noise: float = 0.2  # standard deviation per axis, of the limit
    target_noise_clip: float = 0.5  # of the limit
    effort: float = 0.1  # return that a residual of full length must be worth, quadratic in its length
    behaviour: float = 1.0  # the same of its distance from the one executed there, with few episodes
    few_episodes: float = 25.0  # from these on `behaviour` falls with the root of their number
    delay: int = 2  # updates of the critics per update of the actor
    warm_up: int = 400  # updates of the critics before the first one of the actor
    max_gradient: float = 10.0  # longer gradients are shortened to this

    def __post_init__(self) -> None:
        for name in ("n_step", "batch", "delay", "episodes_per_feature", "few_episodes"):
            if not 1 <= getattr(self, name) < math.inf:
                raise InputError(f"{name} is {getattr(self, name)}, must be at least 1 and finite")
        for name in ("gamma", "average", "critic_rate", "actor_rate", "limit"):
            if not 0.0 < getattr(self, name) <= 1.0:
                raise InputError(f"{name} is {getattr(self, name)}, must be above 0 and at most 1")
        for name in ("target_noise", "target_noise_clip", "blur", "effort", "behaviour", "warm_up"):
            if not 0 <= getattr(self, name) < math.inf:
                raise InputError(f"{name} is {getattr(self, name)}, must be at least 0 and finite")


@dataclass(frozen=True)
class Figures:
    """One update."""

    critic_loss: float  # sum of both critics' squared errors, mean of the batch
    value: float  # mean of the first critic over the batch
    actor_value: float  # the same for the actor's own residuals, NaN when it was not its turn
    residual: float  # mean length of the actor's residuals [m], NaN when it was not its turn


class ResidualLearner:
    """Actor, twin critics, their slow copies and optimisers. Everything random comes from one seed."""

    def __init__(
        self,
        settings: ResidualSettings,
        encoder: Encoder,
        seed: int,
        device: torch.device | str = "cpu",
    ) -> None:
        """Draws the heads; the encoder, the nominal policy's, is copied into the actor."""
        self.settings = settings
        self.device = torch.device(device)
        self.generator = torch.Generator().manual_seed(seed)  # on the CPU: the same draws on every device
        self.actor = ResidualActor(settings.limit, self.generator, encoder).to(self.device)
        self.critic = TwinCritic(settings.limit, self.generator).to(self.device)
        self._target_actor = copy.deepcopy(self.actor).requires_grad_(False)
        self._target_critic = copy.deepcopy(self.critic).requires_grad_(False)
        self._actor_adam = torch.optim.Adam(self.actor.head.parameters(), lr=settings.actor_rate)
        self._critic_adam = torch.optim.Adam(self.critic.parameters(), lr=settings.critic_rate)
        self.updates = 0

    def learn(self, batch_of: Callable[[int, torch.Generator], Batch]) -> Figures:
        """Update from what `batch_of` makes of the batch's size and the learner's generator.

        Raises:
            SolveError: see `update`; from the state that is left then, the same is drawn once more.
        """
        before = self.generator.get_state()
        batch = batch_of(self.settings.batch, self.generator)
        try:
            return self.update(batch)
        except SolveError:
            self.generator.set_state(before)
            raise

    def update(self, batch: Batch) -> Figures:
        """One update of the critics, and of the actor when it is its turn.

        Raises:
            SolveError: a loss or gradient is not finite. No weight was changed by it: the learner's state is
                the one that led to it.
        """
        s = self.settings
        target = self._target(batch)
        tried = batch.residual + self._noise(batch.residual, s.blur)
        features = self._thinned(batch.features, batch.episodes)
        first, second = self.critic(features, batch.nominal, tried)
        critic_loss = functional.mse_loss(first, target) + functional.mse_loss(second, target)
        critic_slopes = self._slopes(critic_loss, self.critic, "critic")
        actor_value = residual = float("nan")
        actor_slopes = None
        if self.updates >= s.warm_up and self.updates % s.delay == 0:
            features = self._thinned(batch.features, batch.episodes)
            action = self.actor.of_features(features, batch.nominal)
            features = self._thinned(batch.features, batch.episodes)
            value = self.critic(features, batch.nominal, action)[0].mean()
            departure = action - batch.residual
            behaviour = s.behaviour * math.sqrt(s.few_episodes / max(s.few_episodes, batch.episodes))
            price = s.effort * _squares(action, s.limit) + behaviour * _squares(departure, s.limit)
            actor_slopes = self._slopes(price - value, self.actor.head, "actor")
            actor_value, residual = value.item(), action.detach().norm(dim=1).mean().item()
        _apply(self._critic_adam, self.critic, critic_slopes)
        if actor_slopes is not None:
            _apply(self._actor_adam, self.actor.head, actor_slopes)
            self._follow(self._target_actor.head, self.actor.head)
        if self.updates % s.delay == 0:
            self._follow(self._target_critic, self.critic)
        self.actor.seen.fill_(self._share(batch.episodes))
        self.updates += 1
        return Figures(critic_loss.item(), first.mean().item(), actor_value, residual)

    def state(self) -> dict[str, torch.Tensor]:
        """All that the next updates depend on, by name; the encoder, which stands still, left out."""
        found: dict[str, torch.Tensor] = {
            "updates": torch.tensor(self.updates),
            "seen": self.actor.seen.detach().cpu().clone(),
            "generator": self.generator.get_state(),
        }
        for name, module in self._modules().items():
            found |= {f"{name}.{key}": value.detach().cpu() for key, value in module.state_dict().items()}
        for name, adam in self._optimisers().items():
            found |= {key: value.detach().cpu() for key, value in adam_tensors(adam, f"{name}.").items()}
        return found

    def load_state(self, state: dict[str, torch.Tensor]) -> None:
        """Go on from what `state` returned.

        Raises:
            InputError: it is another learner's: names or sizes differ.
        """
        try:
            for name, module in self._modules().items():
                module.load_state_dict(with_prefix(state, f"{name}."))
            for name, adam in self._optimisers().items():
                load_adam(adam, state, f"{name}.")
            self.actor.seen.copy_(state["seen"])
            self.generator.set_state(state["generator"])
            self.updates = int(state["updates"])
        except (KeyError, TypeError, ValueError, RuntimeError) as error:
            raise InputError(f"this is no state of this learner ({error}); begin anew elsewhere") from error

    def _target(self, batch: Batch) -> torch.Tensor:
        s = self.settings
        with torch.no_grad():
            longest = s.target_noise_clip * s.limit
            noise = self._noise(batch.nominal, s.target_noise).clamp(-longest, longest)
            features, nominal = self._thinned(batch.next_features, batch.episodes), batch.next_nominal
            action = shortened(self._target_actor.of_features(features, nominal) + noise, s.limit)
            first, second = self._target_critic(features, nominal, action)
            return (batch.reward + batch.discount * torch.minimum(first, second)).clamp(0.0, 1.0)

    def _share(self, episodes: int) -> float:
        """Of the features that an update sees in a step, with so many episodes in the replay."""
        return min(1.0, max(1.0, episodes / self.settings.episodes_per_feature) / FEATURES)

    def _thinned(self, features: torch.Tensor, episodes: int) -> torch.Tensor:
        """Features (B, 128), each step's with others hidden, and what is left made up for it."""
        drawn = torch.rand(features.shape, generator=self.generator)
        return thinned(features, self._share(episodes), drawn.to(self.device))

    def _noise(self, like: torch.Tensor, deviation: float) -> torch.Tensor:
        """Of rows (B, 3), its standard deviation per axis in limits [m]."""
        drawn = torch.randn(like.shape, generator=self.generator)
        return self.settings.limit * deviation * drawn.to(self.device)

    def _slopes(self, loss: torch.Tensor, module: nn.Module, name: str) -> tuple[torch.Tensor, ...]:
        slopes = torch.autograd.grad(loss, list(module.parameters()))
        length = torch.stack([slope.norm() for slope in slopes]).norm()
        if not (bool(torch.isfinite(loss.detach())) and bool(torch.isfinite(length))):
            raise SolveError(
                f"residual learner, update {self.updates}: the {name}'s loss is {loss.item()}, its gradient "
                f"{length.item()} long; look at the newest steps of the replay, or lower the learning rates"
            )
        scale = min(1.0, self.settings.max_gradient / max(length.item(), 1e-12))
        return tuple(scale * slope for slope in slopes)

    def _follow(self, slow: nn.Module, fast: nn.Module) -> None:
        with torch.no_grad():
            for old, new in zip(slow.parameters(), fast.parameters(), strict=True):
                old.lerp_(new, self.settings.average)

    def _modules(self) -> dict[str, nn.Module]:
        return {
            "actor": self.actor.head,
            "critic": self.critic,
            "target_actor": self._target_actor.head,
            "target_critic": self._target_critic,
        }

    def _optimisers(self) -> dict[str, torch.optim.Adam]:
        return {"actor_adam": self._actor_adam, "critic_adam": self._critic_adam}


def shortened(vectors: torch.Tensor, limit: float) -> torch.Tensor:
    """Rows (B, 3), those longer than `limit` cut to it."""
    return vectors * (limit / vectors.norm(dim=1, keepdim=True).clamp(min=limit))


def _squares(vectors: torch.Tensor, unit: float) -> torch.Tensor:
    """Mean over rows (B, 3) of their squared lengths in a unit, ()."""
    return (vectors / unit).square().sum(dim=1).mean()


def _apply(adam: torch.optim.Adam, module: nn.Module, slopes: tuple[torch.Tensor, ...]) -> None:
    for parameter, slope in zip(module.parameters(), slopes, strict=True):
        parameter.grad = slope
    adam.step()
