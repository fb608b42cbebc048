"""How an effect acts at one place: its amplitudes, the grid of its shapes, and the formulas of both.

Every form is separable: with its shape held (a Stribeck velocity, a delay), the residual is linear in its
amplitudes. Amplitudes are then solved exactly, and only shapes are searched
(variable projection; Golub and Pereyra 1973).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Generic

import numpy as np
from typing_extensions import TypeVar

from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.observed import Observed
from samrl_core.diagnosis.residuals.trial import Trial

T = TypeVar("T", bound=Observed, default=Trial)

Shape = dict[str, float]
PlantFields = dict[str, np.ndarray | float]


@dataclass(frozen=True)
class Place:
    """A place of the contract, and the joints (rows of the residual) that it means: one, or all."""

    name: str  # joint:<name>, link:<name>, arm:<role>, sensor:<name>, body:<name> or cell
    joints: tuple[int, ...]

    @staticmethod
    def find(trial: Observed, name: str) -> Place:
        """The place of that name in a recording."""
        return Place(name, trial.rows_at(name))

    @property
    def is_arm(self) -> bool:
        """Whether all joints of the arm are meant."""
        return self.name.startswith("arm:")

    @property
    def index(self) -> int:
        """Index of the joint; -1 for the arm, as in lists of all joints that end with the arm's own entry."""
        return -1 if self.is_arm else self.joints[0]


@dataclass(frozen=True, eq=False, kw_only=True)
class Form(ABC, Generic[T]):
    """One way in which an effect may act at one place.

    A form is made for one recording and used on all recordings of that system.
    """

    deviation: ClassVar[float] = 0.05  # relative, of every parameter: no formula is the thing itself
    may_vanish: ClassVar[tuple[int, ...]] = ()  # amplitudes that are never negative, and may be zero
    thing: str = ""  # what it is, where forms of an effect are several things and not one put otherwise

    name: str = ""  # as printed; empty where an effect has one form only
    place: Place
    amplitudes: tuple[str, ...]
    shapes: tuple[Shape, ...] = ({},)  # the grid on which the search begins
    # shape -> bounds; shapes are searched in their logarithm, beginning with steps of `step`
    refine: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    step: float = 0.35

    @property
    def joint(self) -> int:
        """Index of the only joint of the place."""
        (joint,) = self.place.joints
        return joint

    @abstractmethod
    def columns(self, trial: T, shape: Shape) -> Columns:
        """Residual per unit amplitude, one row per amplitude."""

    @abstractmethod
    def prior(self, trial: T, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        """Mean and standard deviation (p,) of the amplitudes before any data."""

    @abstractmethod
    def parameters(self, trial: T, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        """Reported parameters by name."""

    def sample_parameters(
        self, trial: T, shape: Shape, amplitudes: np.ndarray, rng: np.random.Generator
    ) -> dict[str, float]:
        """The same for one sample of the posterior, with what amplitudes and shapes leave open."""
        return self.parameters(trial, shape, amplitudes)

    def cost(self, trials: Sequence[T], shape: Shape) -> float:
        """Log evidence [nat] that it must win to be as likely as other forms; infinite if it is denied."""
        return 0.0

    def find_own_tolerances(self, trial: T) -> np.ndarray | None:
        """What each tolerance column adds to each amplitude (p, columns) per standard deviation of its own.

        None where no tolerance is of the same quantity.
        """
        return None

    def is_done_by(self, trial: T, name: str) -> bool:
        """Whether another effect, `family@place`, can do the same in whatever recordings, by geometry."""
        return False

    def find_unresolved(self, trial: T, shape: Shape) -> np.ndarray:
        """Covariance (p, p) of amplitudes that recordings of this kind cannot tell, whatever their noise."""
        return np.zeros((len(self.amplitudes), len(self.amplitudes)))

    def find_seen(self, trial: T, shape: Shape, amplitudes: np.ndarray) -> T:
        """The recording with what it would still tell of an effect of that size, were there one: all of it.

        A lamp that drives colours to white, for example, takes them out of the comparison.
        """
        return trial

    def is_admissible(self, trial: T, shape: Shape, amplitudes: np.ndarray) -> bool:
        """Whether amplitudes are physically possible (no negative friction, say)."""
        return True

    def plant_fields(self, trial: T, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        """Fields of `PlantParameters` for closed-loop re-simulation; None where it cannot be simulated."""
        return None

    def at_joints(self, trial: Trial, value: float | np.ndarray, neutral: float = 0.0) -> np.ndarray:
        """(J,) neutral but at the joints of the place; `value` is one for all of them, or one each."""
        out = np.full(trial.joints, neutral)
        out[list(self.place.joints)] = value
        return out


class PresentForm(Form[T], Generic[T]):
    """A form that is there or not: its amplitude is one, and only its shape is unknown.

    A small freedom of the amplitude absorbs that a real filter is not exactly of first order.
    """

    freedom: ClassVar[float] = 0.05

    def prior(self, trial: T, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        """Centred on one."""
        return np.ones(1), np.full(1, self.freedom)

    def is_admissible(self, trial: T, shape: Shape, amplitudes: np.ndarray) -> bool:
        """Must be present."""
        return bool(amplitudes[0] > 0.5) and self.is_possible(trial, shape)

    def is_possible(self, trial: T, shape: Shape) -> bool:
        """Whether the shape is possible in this recording."""
        return True
