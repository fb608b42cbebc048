"""What an effect is: a family of the catalogue as regressors of the residual, and as a change of the plant.

Every effect is separable: with its shape parameters held (a Stribeck velocity, a delay), the residual is
linear in its amplitudes. Amplitudes are then solved exactly, and only shapes are searched
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


@dataclass(frozen=True)
class Parameter:
    """A physical parameter as reported."""

    name: str
    unit: str
    low: float  # plausible range of the catalogue (gap.md 5) for a Panda-class arm
    high: float
    meaning: str
    bounded: bool = True  # an angle that may be anything has no plausible range


@dataclass(frozen=True)
class Form:
    """One way in which a family may act: its amplitudes and the grid that its shapes are searched on."""

    name: str
    amplitudes: tuple[str, ...]
    shapes: tuple[Shape, ...] = ({},)
    # shape -> bounds; shapes are searched in their logarithm, beginning with steps of `step`
    refine: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    step: float = 0.35


class Effect(ABC):
    """A family of the contract. `place` is a joint name, a link name or the arm's role, without prefix."""

    family: ClassVar[str]
    number: ClassVar[int]
    title: ClassVar[str]  # starts a sentence
    proper_name: ClassVar[bool] = False  # its title keeps its capital within a sentence
    meaning: ClassVar[str]  # what it physically is, in one sentence, for whoever stands beside the machine
    remedy: ClassVar[str]  # what to do about it, in one or two sentences
    formula: ClassVar[str]
    source: ClassVar[str]
    acts_on: ClassVar[str]  # command, dynamics or reading
    excitation: ClassVar[str]  # the motion that shows it, in words
    experiment: ClassVar[str] = "slow"  # the excitation trajectory of the catalogue that shows it best
    curve_over: ClassVar[str] = "effort"  # what the report plots it against: a key of `curves.AXES`
    confounded_with: ClassVar[tuple[str, ...]] = ()
    parameters: ClassVar[tuple[Parameter, ...]]
    renamed_shapes: ClassVar[tuple[str, ...]] = ()  # shapes that are reported under another name
    place_kind: ClassVar[str] = "joint"  # joint, link or arm
    prior_cost: ClassVar[float] = 0.0  # [nat] less likely before any data than other families
    least_share: ClassVar[float] = (
        0.0  # of its prediction that must be seen: tolerances may not undo the rest
    )
    at_every_joint: ClassVar[bool] = False  # may also act at all joints of an arm, each with its own size
    by_chance: ClassVar[bool] = False  # happens at random times: a held-out recording cannot confirm when

    @property
    def running_title(self) -> str:
        """The title as it stands within a sentence."""
        return self.title if self.proper_name else self.title[:1].lower() + self.title[1:]

    def places(self, trial: Trial) -> tuple[str, ...]:
        """Contract places at which the effect may act on this arm."""
        if self.place_kind == "joint":
            return tuple(f"joint:{name}" for name in trial.recording.arm.joints)
        if self.place_kind == "arm":
            return (f"arm:{trial.recording.arm.role}",)
        assert trial.rigid is not None
        return tuple(f"link:{name}" for name in trial.rigid.links)

    def joints_at(self, trial: Trial, place: str) -> tuple[int, ...]:
        """Indices of the joints that a place means: one, or all for the arm."""
        kind, _, name = place.partition(":")
        if kind == "joint":
            return (trial.recording.arm.joints.index(name),)
        return tuple(range(trial.joints))

    def unobservable(self, trial: Trial) -> str | None:
        """Why this recording cannot show the effect at all; None if it can."""
        return None

    @abstractmethod
    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        """Forms with their grids, for this arm and sampling."""

    @abstractmethod
    def columns(self, trial: Trial, place: str, form: str, shape: Shape) -> Columns:
        """Residual per unit amplitude, one row per amplitude."""

    @abstractmethod
    def prior(self, trial: Trial, place: str, form: str, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        """Mean and standard deviation (p,) of the amplitudes before any data."""

    @abstractmethod
    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        """Reported parameters by name, from amplitudes and shape."""

    def drawn(
        self,
        trial: Trial,
        place: str,
        form: str,
        shape: Shape,
        amplitudes: np.ndarray,
        rng: np.random.Generator,
    ) -> dict[str, float]:
        """The same for one draw of the posterior; drawn too is what amplitudes and shapes leave open."""
        return self.physical(trial, place, form, shape, amplitudes)

    def cost(self, trials: Sequence[Trial], place: str, form: str, shape: Shape) -> float:
        """Evidence [nat] that it must win to be as likely as other effects; infinite if it is denied."""
        return self.prior_cost

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        """Whether amplitudes are physically possible (no negative friction, say)."""
        return True

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        """Fields of `PlantParameters` for closed-loop re-simulation; None where it cannot be simulated."""
        return None


def at_joint(
    trial: Trial, joints: tuple[int, ...], value: float | np.ndarray, neutral: float = 0.0
) -> np.ndarray:
    """(J,) neutral but at some joints; `value` is one for all of them, or one each."""
    out = np.full(trial.joints, neutral)
    out[list(joints)] = value
    return out
