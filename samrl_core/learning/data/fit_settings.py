"""How a regression runs, and what it gave."""

from __future__ import annotations

import math
from dataclasses import dataclass

from samrl_core.common.devices import checked_device
from samrl_core.common.errors import InputError


@dataclass(frozen=True)
class FitSettings:
    """One training.

    Raises:
        InputError: a value outside its limits, or a device that is not there.
    """

    epochs: int = 30
    batch_size: int = 128
    learning_rate: float = 1e-3  # highest, of Adam
    warm_up: float = 0.03  # share of all steps in which the rate rises from 0
    max_gradient: float = 1.0  # norm to which a longer gradient is cut
    seed: int = 0  # of the first weights and of the samples' order
    device: str = "cpu"  # torch's name
    bfloat16: bool = False  # autocast of the convolutions
    checkpoint_every: int = 500  # steps between two checkpoints; each epoch's end is one anyway

    def __post_init__(self) -> None:
        for name in ("epochs", "batch_size", "checkpoint_every"):
            if getattr(self, name) < 1:
                raise InputError(f"{name} is {getattr(self, name)}, must be at least 1")
        for name in ("learning_rate", "max_gradient"):
            if not 0 < getattr(self, name) < math.inf:
                raise InputError(f"{name} is {getattr(self, name)}, must be positive and finite")
        if not 0 <= self.warm_up < 1:
            raise InputError(f"warm_up is {self.warm_up}, must be a share of the steps, 0 to below 1")
        checked_device(self.device)

    def rate(self, step: int, steps: int) -> float:
        """Learning rate of a step: up to the highest, then half a cosine down to 0."""
        rising = max(1, round(self.warm_up * steps))
        if step < rising:
            return self.learning_rate * (step + 1) / rising
        return 0.5 * self.learning_rate * (1 + math.cos(math.pi * (step - rising) / max(1, steps - rising)))


@dataclass(frozen=True)
class FitResult:
    """What a finished training gave."""

    steps: int
    figures: dict[str, float]  # means over the validation samples, at the end
    rows: tuple[dict[str, float], ...]  # of the log, one per epoch
