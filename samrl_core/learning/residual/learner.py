"""What a learner of the residual is: settings, an actor for the cell, updates from batches, a state.

The training beside the cell (`training`), its process (`worker`), the node `residual_trainer` and the studies
know learners by these two protocols alone. `learners` lists them by name.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, Protocol

import torch

from samrl_core.learning.residual.transitions import Batch
from samrl_core.policy.networks.networks import Encoder, ResidualActor

SampleBatch = Callable[[int, torch.Generator], Batch]  # of a batch size and a source of random numbers


class LearnerSettings(Protocol):
    """A frozen dataclass; these fields every learner has."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def limit(self) -> float:
        """Longest residual [m]."""
        ...

    @property
    def batch_size(self) -> int:
        """Transitions per update."""
        ...

    @property
    def gamma(self) -> float:
        """Discount per action, above 0 and at most 1."""
        ...

    @property
    def n_step(self) -> int:
        """Actions over which a transition's reward is summed up."""
        ...


class Learner(Protocol):
    """Trains a residual policy; everything random comes from its seed."""

    Settings: ClassVar[type[Any]]  # `LearnerSettings` that can be created without arguments
    METRICS: ClassVar[tuple[str, ...]]  # names of what `update` returns, columns of `training.csv`
    OLD_NAMES: ClassVar[dict[str, str]]  # settings of earlier versions and their names today

    updates: int  # done so far

    def __init__(
        self, settings: Any, encoder: Encoder, seed: int, device: torch.device | str = "cpu"
    ) -> None:
        """Draws the first weights.

        Args:
            settings: of type `Settings`.
            encoder: the nominal policy's; it stays as it is.
            seed: of everything random.
            device: torch's, where the updates are computed.
        """
        ...

    @property
    def actor(self) -> ResidualActor:
        """What acts; before the first update its residual is zero."""
        ...

    def update(self, sample_batch: SampleBatch) -> dict[str, float]:
        """One update; its metrics, NaN for what does not apply to it.

        Raises:
            SolveError: a loss or gradient is not finite. The state is the one that led to it.
        """
        ...

    def state(self) -> dict[str, torch.Tensor]:
        """All that the next updates depend on, by name; the encoder, which is never trained, left out."""
        ...

    def load_state(self, state: dict[str, torch.Tensor]) -> None:
        """Go on from what `state` returned.

        Raises:
            InputError: it is another learner's: names or sizes differ.
        """
        ...
