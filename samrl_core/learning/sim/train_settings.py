"""How a task is learnt in the model, from nothing to weights."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.common.errors import InputError
from samrl_core.learning.data.fit import FitSettings
from samrl_core.learning.images.acted_samples import ActedSettings
from samrl_core.learning.randomisation.adr import AdrSettings
from samrl_core.learning.randomisation.found import FoundSettings
from samrl_core.learning.randomisation.simopt import SimOptSettings
from samrl_core.learning.randomisation.strategy import RANDOMISATIONS, REAL2SIM
from samrl_core.learning.sim.regressions import Q_LOSSES
from samrl_core.learning.states.explore import ExploreSettings

Q_TARGETS = ("return", "action")


@dataclass(frozen=True)
class TrainSettings:
    """Sizes of all stages. The defaults take about two hours on two cores, minutes on a GPU.

    Raises:
        InputError: no such cell, a count below its least value, or one that a later stage could not use.
    """

    states: int = 12_000  # labelled states
    explore: ExploreSettings = ExploreSettings()
    validation: float = 0.05  # share of them for validation
    rounds: int = 1  # of DAgger: the actor's own states are labelled and added (Ross et al. 2011)
    round_episodes: int = 128  # of each round, half of them with a view held
    episodes: int = 512  # for Q (eq. 24), each with a view held
    action_noise: float = 0.3  # highest level of theirs, per axis, standard deviation [action limits]
    q_target: str = "action"  # what Q learns: worth of the "action" in its state, or "return" of episodes
    q_loss: str = "square"  # how: by the "square" of eq. 24, or by "likelihood"; see `regressions.py`
    acted: ActedSettings = ActedSettings()  # actions that Q learns the worth of, and their worth
    judged: int = 200  # episodes of the actor's evaluation, for each kind of view
    group: int = 32  # episodes side by side in one process; what is lost when a training is killed
    max_actions: int = 0  # of an episode; 0 takes the task's
    kept: int = 0  # images of each state that are rendered once and cached; 0 renders all anew each time
    actor: FitSettings = field(default_factory=lambda: FitSettings(epochs=40))
    q: FitSettings = field(default_factory=lambda: FitSettings(epochs=15))
    randomisation: str = REAL2SIM  # of `RANDOMISATIONS`: distribution of the models
    adr: AdrSettings = AdrSettings()
    simopt: SimOptSettings = SimOptSettings()
    found: FoundSettings = FoundSettings()
    cell: str = DEFAULT_CELL  # whose arm moves and whose camera looks
    seed: int = 0
    device: str = "cpu"  # torch's name; renders and trains
    workers: int = 0  # processes that sample and label states and run episodes; 0 takes the free cores

    levels: ClassVar[int] = 4  # of noise on the actions of Q's episodes, from none; one per group in turn

    def __post_init__(self) -> None:
        cell_named(self.cell)
        if self.q_target not in Q_TARGETS:
            raise InputError(f"q_target is {self.q_target!r}, must be one of: {', '.join(Q_TARGETS)}")
        if self.q_loss not in Q_LOSSES:
            raise InputError(f"q_loss is {self.q_loss!r}, must be one of: {', '.join(Q_LOSSES)}")
        least = {
            "states": 100,
            "rounds": 0,
            "round_episodes": 1,
            "episodes": 2,
            "judged": 1,
            "group": 1,
            "max_actions": 0,
            "kept": 0,
        }
        for name, value in least.items():
            if getattr(self, name) < value:
                raise InputError(f"{name} is {getattr(self, name)}, must be at least {value}")
        if self.randomisation not in RANDOMISATIONS:
            raise InputError(
                f"no randomisation is named {self.randomisation!r}; there are: {', '.join(RANDOMISATIONS)}"
            )
        if not 0.0 < self.validation < 0.5:
            raise InputError(f"validation is {self.validation}, must be a share above 0 and below 0.5")
        if self.workers < 0 or self.action_noise < 0.0:
            raise InputError(
                f"workers {self.workers} and action_noise {self.action_noise} must be at least 0"
            )
        known = round((1.0 - self.validation) * self.states)
        if known < self.actor.batch_size:
            raise InputError(
                f"{self.states} states leave {known} to learn from, a batch of the actor has "
                f"{self.actor.batch_size}; ask for more states or a smaller batch"
            )
        # To learn from, and to validate, at each level of noise.
        least_episodes = 2 * self.levels * self.group
        if self.episodes < least_episodes:
            raise InputError(
                f"episodes is {self.episodes}, must be at least {least_episodes}: {self.levels} levels of "
                f"noise, groups of {self.group}, half of them to validate; ask for more or smaller groups"
            )
