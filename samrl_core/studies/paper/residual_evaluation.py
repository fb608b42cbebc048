"""How a run of residual training goes, which episodes it plays, and how a residual of it is evaluated.

An episode is determined by the run's seed, its number and its purpose alone, so that saved weights can be
evaluated at any time and in any process with the same result.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from torch import nn

from samrl_core.cell.robots.robot import CellSpec
from samrl_core.common.errors import InputError
from samrl_core.learning.residual.learner import LearnerSettings
from samrl_core.learning.residual.td3 import TD3Settings
from samrl_core.learning.residual.training import TrainingSettings
from samrl_core.policy.networks.weights import WeightsInfo, load_weights
from samrl_core.studies.episodes.residual_episodes import EpisodeSite, Order, Play

TRAINING, EVALUATION = 1, 2  # seeds of scenes never meet: these come first in what they are made of


@dataclass(frozen=True)
class RunSettings:
    """How a run goes.

    Raises:
        InputError: a value outside its limits.
    """

    points: tuple[int, ...]  # real steps at which is evaluated; the last one ends the run
    learner: LearnerSettings = TD3Settings()  # which learner follows from their type
    episodes: int = 8  # per round, at least: while the longest of them lasts, nothing is learnt
    growth: float = 0.25  # more of them, up to this share of all before: they are played side by side
    first_steps: int = TrainingSettings.first_steps  # in the replay before the first update
    updates_per_step: float = (
        TrainingSettings.updates_per_step
    )  # each step beyond the first ones allows so many
    # Small and steady: 1.5 mm that change within an episode keep the tool from where the nominal policy goes
    # on from, so that nothing succeeds, and there is no reward to learn from.
    exploration: float = 0.00075  # standard deviation per axis of what is tried [m]
    memory: float = 0.98  # of the exploration from action to action
    evaluated: int = 20  # episodes per evaluation
    max_actions: int = 40  # of an episode

    def __post_init__(self) -> None:
        if not self.points or list(self.points) != sorted(set(self.points)) or self.points[0] < 0:
            raise InputError(f"evaluation points {self.points} must grow from 0 or more")
        for name in ("episodes", "first_steps", "evaluated", "max_actions"):
            if getattr(self, name) < 1:
                raise InputError(f"{name} is {getattr(self, name)}, must be at least 1")
        if not 0.0 <= self.growth < np.inf:
            raise InputError(f"growth is {self.growth}, must be at least 0 and finite")
        if not (self.updates_per_step > 0 and self.exploration > 0 and 0 <= self.memory <= 1):
            raise InputError(
                f"updates_per_step {self.updates_per_step} and exploration {self.exploration} m must be "
                f"above 0, memory {self.memory} within 0..1"
            )


@dataclass(frozen=True)
class Evaluated:
    """A residual without exploration; none of it is learnt from."""

    successes: list[bool]  # by the truth, per episode
    detected: list[bool]  # by the model
    final_errors: list[float]  # [m]
    actions: list[int]
    errors: list[str]  # of episodes that an error ended
    residual: float  # mean length [m]


def weights_of(actor: nn.Module, updates: float) -> dict[str, np.ndarray]:
    """A residual's actor by name, as an order has it; none before the first update, when it is zero."""
    if not updates:
        return {}
    return {name: value.cpu().numpy() for name, value in actor.state_dict().items()}


def order_of(
    kind: int,
    number: int,
    site: EpisodeSite,
    seed: int,
    settings: RunSettings,
    weights: dict[str, np.ndarray],
) -> Order:
    """One episode.

    Args:
        kind: TRAINING or EVALUATION.
        number: of the episode among those of its kind.
        site: where it is played.
        seed: of the run.
        settings: of the run.
        weights: see `weights_of`; none is the zero residual.
    """
    scene, noise = np.random.SeedSequence([kind, seed, number]).generate_state(2) >> 1
    s = settings
    return Order(
        site, int(scene), s.max_actions, weights, s.learner.limit, s.exploration, s.memory, int(noise)
    )


def evaluated(
    play: Play, site: EpisodeSite, seed: int, settings: RunSettings, weights: dict[str, np.ndarray]
) -> Evaluated:
    """Episodes of the run's own scenes, the same ones for all weights; arguments as of `order_of`."""
    orders = [order_of(EVALUATION, k, site, seed, settings, weights) for k in range(settings.evaluated)]
    played = play([replace(order, exploration=0.0) for order in orders])
    lengths = [np.linalg.norm(step.residual) for one in played for step in one.steps]
    return Evaluated(
        [one.success for one in played],
        [one.ended == "done" for one in played],
        [one.final_error for one in played],
        [len(one.steps) for one in played],
        [one.why for one in played if one.ended == "error"],
        float(np.mean(lengths)) if lengths else 0.0,
    )


def evaluated_file(
    play: Play, site: EpisodeSite, seed: int, settings: RunSettings, file: Path, cell: CellSpec
) -> tuple[Evaluated, WeightsInfo]:
    """A residual that a run has saved, and its file's description.

    Args:
        play: plays the episodes.
        site: where they are played.
        seed: of the run.
        settings: of the run.
        file: of `ResidualRun.save_weights`.
        cell: whose camera the residual is for.

    Raises:
        InputError: the file does not fit; see `load_weights`.
    """
    actor, info = load_weights(file, "residual_actor", site.task, cell)
    weights = weights_of(actor, info.figures["updates"])
    return evaluated(play, site, seed, settings, weights), info
