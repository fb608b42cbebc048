"""TD3 (Fujimoto et al. 2018) trains the residual (eqs. 13-16) on the real image and the nominal action.

Differences from plain TD3:
- The actor's last layer starts at zero, so that the first policy is the model's (eq. 15).
- Actions are bounded in length, not per axis.
- Returns run over 100 actions, mostly to the end of the episode, where the only reward comes.
- The target is clipped to 0..1, where every return of eq. 16 lies.
- Critics train alone at first: the actor would climb errors of untrained critics.
- Behaviour cloning holds the actor to executed residuals (Fujimoto & Gu 2021, "A minimalist approach to
  offline RL"). Its weight falls with the root of the number of episodes, as the critics' error does. With a
  constant weight no residual moves far from where it began.

The encoder is the nominal policy's and frozen: the learner works on its 128 features per step. Trained
convolutions overfitted a few dozen episodes, and an update took 3.6 s of one core (batch of 64). Features
alone still identify each episode. So each update drops most of them at random (dropout; Srivastava et al.
2014), fewer the more episodes there are: a regression needs several events per variable (Peduzzi et al.
1996). Exploration is correlated over an episode, so residuals identify it as well: critics see them with
action noise.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import nn
from torch.nn import functional

from samrl_core.common.errors import InputError, SolveError
from samrl_core.learning.data.checkpoint import adam_tensors, load_adam, with_prefix
from samrl_core.learning.residual.learner import SampleBatch
from samrl_core.learning.residual.transitions import Batch
from samrl_core.policy.networks.networks import (
    FEATURES,
    OLD_KEYS,
    Encoder,
    ResidualActor,
    TwinCritic,
    drop_features,
)


@dataclass(frozen=True)
class TD3Settings:
    """Settings of the learner.

    Raises:
        InputError: a value outside its limits.
    """

    limit: float = 0.003  # longest residual, ASSUMPTION: above the error of updated models [m]
    gamma: float = 0.97  # discount per action: half of the reward is left after 23
    n_step: int = 100  # actions until a return is bootstrapped; most episodes end before
    batch_size: int = 256  # transitions per update
    critic_lr: float = 3e-4  # of Adam
    actor_lr: float = 6e-5  # of Adam
    tau: float = 0.01  # share of the new weights in the target networks, per update of the actor
    policy_delay: int = 2  # updates of the critics per update of the actor
    target_noise: float = 0.2  # on the target's action, standard deviation per axis [limit]
    target_noise_clip: float = 0.5  # [limit]
    action_noise: float = 0.1  # on the residuals that critics learn from, per axis [limit]
    episodes_per_feature: float = 4.0  # in the replay, per feature that dropout keeps
    penalty_weight: float = 0.1  # return that a residual of full length must gain, quadratic in its length
    behaviour_cloning_weight: float = 1.0  # the same for its distance from the executed one, few episodes
    few_episodes: float = 25.0  # above, the behaviour-cloning weight falls with the root of their number
    warm_up: int = 400  # updates of the critics before the first one of the actor
    max_gradient_norm: float = 10.0  # gradient clipping

    def __post_init__(self) -> None:
        for name in ("n_step", "batch_size", "policy_delay", "episodes_per_feature", "few_episodes"):
            if not 1 <= getattr(self, name) < math.inf:
                raise InputError(f"{name} is {getattr(self, name)}, must be at least 1 and finite")
        for name in ("gamma", "tau", "critic_lr", "actor_lr", "limit"):
            if not 0.0 < getattr(self, name) <= 1.0:
                raise InputError(f"{name} is {getattr(self, name)}, must be above 0 and at most 1")
        weights = ("penalty_weight", "behaviour_cloning_weight")
        for name in ("target_noise", "target_noise_clip", "action_noise", *weights, "warm_up"):
            if not 0 <= getattr(self, name) < math.inf:
                raise InputError(f"{name} is {getattr(self, name)}, must be at least 0 and finite")


class TD3:
    """Actor, twin critics, their target networks and optimisers; see `Learner`."""

    Settings: ClassVar[type[TD3Settings]] = TD3Settings
    # Sum of both critics' squared errors; mean of the first critic over the batch; the same for the actor's
    # residuals, and their mean length [m], both NaN when the actor was not updated.
    METRICS: ClassVar[tuple[str, ...]] = ("critic_loss", "value", "actor_value", "residual")
    OLD_NAMES: ClassVar[dict[str, str]] = {
        "batch": "batch_size",
        "critic_rate": "critic_lr",
        "actor_rate": "actor_lr",
        "average": "tau",
        "delay": "policy_delay",
        "blur": "action_noise",
        "effort": "penalty_weight",
        "behaviour": "behaviour_cloning_weight",
        "max_gradient": "max_gradient_norm",
    }

    def __init__(
        self, settings: TD3Settings, encoder: Encoder, seed: int, device: torch.device | str = "cpu"
    ) -> None:
        """See `Learner`; the encoder is copied into the actor."""
        self.settings = settings
        self.device = torch.device(device)
        self.generator = torch.Generator().manual_seed(seed)  # on the CPU: the same numbers on every device
        self.actor = ResidualActor(settings.limit, self.generator, encoder).to(self.device)
        self.critic = TwinCritic(settings.limit, self.generator).to(self.device)
        self._target_actor = copy.deepcopy(self.actor).requires_grad_(False)
        self._target_critic = copy.deepcopy(self.critic).requires_grad_(False)
        self._actor_adam = torch.optim.Adam(self.actor.head.parameters(), lr=settings.actor_lr)
        self._critic_adam = torch.optim.Adam(self.critic.parameters(), lr=settings.critic_lr)
        self.updates = 0

    def update(self, sample_batch: SampleBatch) -> dict[str, float]:
        """See `Learner`."""
        before = self.generator.get_state()
        batch = sample_batch(self.settings.batch_size, self.generator)
        try:
            return self.update_on(batch)
        except SolveError:
            self.generator.set_state(before)
            raise

    def update_on(self, batch: Batch) -> dict[str, float]:
        """One update of the critics, and of the actor when it is its turn.

        Raises:
            SolveError: a loss or gradient is not finite. No weight was changed by it: the learner's state is
                the one that led to it.
        """
        s = self.settings
        target = self._target(batch)
        residual = batch.residual + self._noise(batch.residual, s.action_noise)
        features = self._dropout(batch.features, batch.episodes)
        first, second = self.critic(features, batch.nominal, residual)
        critic_loss = functional.mse_loss(first, target) + functional.mse_loss(second, target)
        critic_gradients = self._clipped_gradients(critic_loss, self.critic, "critic")
        actor_value = length = float("nan")
        actor_gradients = None
        if self.updates >= s.warm_up and self.updates % s.policy_delay == 0:
            features = self._dropout(batch.features, batch.episodes)
            action = self.actor.of_features(features, batch.nominal)
            features = self._dropout(batch.features, batch.episodes)
            value = self.critic(features, batch.nominal, action)[0].mean()
            cloning = s.behaviour_cloning_weight * math.sqrt(
                s.few_episodes / max(s.few_episodes, batch.episodes)
            )
            penalty = s.penalty_weight * _mean_square(action, s.limit)
            penalty = penalty + cloning * _mean_square(action - batch.residual, s.limit)
            actor_gradients = self._clipped_gradients(penalty - value, self.actor.head, "actor")
            actor_value, length = value.item(), action.detach().norm(dim=1).mean().item()
        _step(self._critic_adam, self.critic, critic_gradients)
        if actor_gradients is not None:
            _step(self._actor_adam, self.actor.head, actor_gradients)
            self._update_target(self._target_actor.head, self.actor.head)
        if self.updates % s.policy_delay == 0:
            self._update_target(self._target_critic, self.critic)
        self.actor.keep_prob.fill_(self._keep_prob(batch.episodes))
        self.updates += 1
        metrics = (critic_loss.item(), first.mean().item(), actor_value, length)
        return dict(zip(self.METRICS, metrics, strict=True))

    def state(self) -> dict[str, torch.Tensor]:
        """See `Learner`."""
        found: dict[str, torch.Tensor] = {
            "updates": torch.tensor(self.updates),
            "keep_prob": self.actor.keep_prob.detach().cpu().clone(),
            "generator": self.generator.get_state(),
        }
        for name, module in self._modules().items():
            found |= {f"{name}.{key}": value.detach().cpu() for key, value in module.state_dict().items()}
        for name, adam in self._optimisers().items():
            found |= {key: value.detach().cpu() for key, value in adam_tensors(adam, f"{name}.").items()}
        return found

    def load_state(self, state: dict[str, torch.Tensor]) -> None:
        """See `Learner`."""
        state = {OLD_KEYS.get(key, key): value for key, value in state.items()}
        try:
            for name, module in self._modules().items():
                module.load_state_dict(with_prefix(state, f"{name}."))
            for name, adam in self._optimisers().items():
                load_adam(adam, state, f"{name}.")
            self.actor.keep_prob.copy_(state["keep_prob"])
            self.generator.set_state(state["generator"])
            self.updates = int(state["updates"])
        except (KeyError, TypeError, ValueError, RuntimeError) as error:
            raise InputError(f"this is no state of this learner ({error}); begin anew elsewhere") from error

    def _target(self, batch: Batch) -> torch.Tensor:
        """The return that the critics learn (B,), from the target networks."""
        s = self.settings
        with torch.no_grad():
            longest = s.target_noise_clip * s.limit
            noise = self._noise(batch.nominal, s.target_noise).clamp(-longest, longest)
            features, nominal = self._dropout(batch.next_features, batch.episodes), batch.next_nominal
            action = clip_norm(self._target_actor.of_features(features, nominal) + noise, s.limit)
            first, second = self._target_critic(features, nominal, action)
            return (batch.reward + batch.discount * torch.minimum(first, second)).clamp(0.0, 1.0)

    def _keep_prob(self, episodes: int) -> float:
        """Share of the features that dropout keeps, with so many episodes in the replay."""
        return min(1.0, max(1.0, episodes / self.settings.episodes_per_feature) / FEATURES)

    def _dropout(self, features: torch.Tensor, episodes: int) -> torch.Tensor:
        """Features (B, 128), others dropped in each row, the kept ones scaled up."""
        uniform = torch.rand(features.shape, generator=self.generator)
        return drop_features(features, self._keep_prob(episodes), uniform.to(self.device))

    def _noise(self, like: torch.Tensor, deviation: float) -> torch.Tensor:
        """For rows (B, 3), with a standard deviation per axis in limits [m]."""
        normal = torch.randn(like.shape, generator=self.generator)
        return self.settings.limit * deviation * normal.to(self.device)

    def _clipped_gradients(
        self, loss: torch.Tensor, module: nn.Module, name: str
    ) -> tuple[torch.Tensor, ...]:
        gradients = torch.autograd.grad(loss, list(module.parameters()))
        norm = torch.stack([gradient.norm() for gradient in gradients]).norm()
        if not (bool(torch.isfinite(loss.detach())) and bool(torch.isfinite(norm))):
            raise SolveError(
                f"TD3, update {self.updates}: the {name}'s loss is {loss.item()}, the norm of its gradient "
                f"{norm.item()}; check the newest steps of the replay, or lower the learning rates"
            )
        scale = min(1.0, self.settings.max_gradient_norm / max(norm.item(), 1e-12))
        return tuple(scale * gradient for gradient in gradients)

    def _update_target(self, target: nn.Module, module: nn.Module) -> None:
        with torch.no_grad():
            for old, new in zip(target.parameters(), module.parameters(), strict=True):
                old.lerp_(new, self.settings.tau)

    def _modules(self) -> dict[str, nn.Module]:
        return {
            "actor": self.actor.head,
            "critic": self.critic,
            "target_actor": self._target_actor.head,
            "target_critic": self._target_critic,
        }

    def _optimisers(self) -> dict[str, torch.optim.Adam]:
        return {"actor_adam": self._actor_adam, "critic_adam": self._critic_adam}


def clip_norm(vectors: torch.Tensor, limit: float) -> torch.Tensor:
    """Rows (B, 3), those longer than `limit` scaled to it."""
    return vectors * (limit / vectors.norm(dim=1, keepdim=True).clamp(min=limit))


def _mean_square(vectors: torch.Tensor, unit: float) -> torch.Tensor:
    """Mean over rows (B, 3) of their squared lengths in a unit, ()."""
    return (vectors / unit).square().sum(dim=1).mean()


def _step(adam: torch.optim.Adam, module: nn.Module, gradients: tuple[torch.Tensor, ...]) -> None:
    for parameter, gradient in zip(module.parameters(), gradients, strict=True):
        parameter.grad = gradient
    adam.step()
