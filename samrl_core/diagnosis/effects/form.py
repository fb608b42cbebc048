"""How an effect acts at one place: its amplitudes, the grid of its shapes, and the formulas of both.

Every form is separable: with its shape held (a Stribeck velocity, a delay), the residual is linear in its
amplitudes. Amplitudes are then solved exactly, and only shapes are searched
(variable projection; Golub and Pereyra 1973).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial

Shape = dict[str, float]
PlantFields = dict[str, np.ndarray | float]


@dataclass(frozen=True)
class Place:
    """A place of the contract, and the joints that it means: one, or all of an arm."""

    name: str  # joint:<name>, link:<name> or arm:<role>
    joints: tuple[int, ...]

    @staticmethod
    def find(trial: Trial, name: str) -> Place:
        """The place of that name on a recording's arm."""
        kind, _, joint = name.partition(":")
        if kind == "joint":
            return Place(name, (trial.recording.arm.joints.index(joint),))
        return Place(name, tuple(range(trial.joints)))

    @property
    def is_arm(self) -> bool:
        """Whether all joints of the arm are meant."""
        return self.name.startswith("arm:")

    @property
    def index(self) -> int:
        """Index of the joint; -1 for the arm, as in lists of all joints that end with the arm's own entry."""
        return -1 if self.is_arm else self.joints[0]


@dataclass(frozen=True, eq=False, kw_only=True)
class Form(ABC):
    """One way in which an effect may act at one place of an arm.

    A form is made for one recording and used on all recordings of that arm.
    """

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
    def columns(self, trial: Trial, shape: Shape) -> Columns:
        """Residual per unit amplitude, one row per amplitude."""

    @abstractmethod
    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        """Mean and standard deviation (p,) of the amplitudes before any data."""

    @abstractmethod
    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        """Reported parameters by name."""

    def sample_parameters(
        self, trial: Trial, shape: Shape, amplitudes: np.ndarray, rng: np.random.Generator
    ) -> dict[str, float]:
        """The same for one sample of the posterior, with what amplitudes and shapes leave open."""
        return self.parameters(trial, shape, amplitudes)

    def cost(self, trials: Sequence[Trial], shape: Shape) -> float:
        """Log evidence [nat] that it must win to be as likely as other forms; infinite if it is denied."""
        return 0.0

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        """Whether amplitudes are physically possible (no negative friction, say)."""
        return True

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        """Fields of `PlantParameters` for closed-loop re-simulation; None where it cannot be simulated."""
        return None

    def at_joints(self, trial: Trial, value: float | np.ndarray, neutral: float = 0.0) -> np.ndarray:
        """(J,) neutral but at the joints of the place; `value` is one for all of them, or one each."""
        out = np.full(trial.joints, neutral)
        out[list(self.place.joints)] = value
        return out


class PresentForm(Form):
    """A form that is there or not: its amplitude is one, and only its shape is unknown.

    A small freedom of the amplitude absorbs that a real filter is not exactly of first order.
    """

    freedom: ClassVar[float] = 0.05

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        """Centred on one."""
        return np.ones(1), np.full(1, self.freedom)

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        """Must be present."""
        return bool(amplitudes[0] > 0.5) and self.is_possible(trial, shape)

    def is_possible(self, trial: Trial, shape: Shape) -> bool:
        """Whether the shape is possible in this recording."""
        return True
