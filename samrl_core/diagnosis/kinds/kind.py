"""What a kind of recording brings to the diagnosis; all else is the same for every kind."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar, Generic, Protocol, TypeVar

import numpy as np

from samrl_core.diagnosis.effects import Effect
from samrl_core.diagnosis.export.correction import Correction
from samrl_core.diagnosis.export.recalibration import Recalibration
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.observed import Observed
from samrl_core.diagnosis.result import Curve, Diagnosis, NextExperiment
from samrl_core.diagnosis.selection.description import WrongDescription
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, Hypothesis
from samrl_core.diagnosis.verdict.how_far import HowFar
from samrl_core.diagnosis.verdict.judge import Doubts


class Recording(Protocol):
    """What the report tells of any recording, which is a dataclass."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def name(self) -> str: ...
    @property
    def source(self) -> str: ...
    @property
    def sha256(self) -> str: ...
    @property
    def duration(self) -> float: ...


R = TypeVar("R", bound=Recording)


class Kind(ABC, Generic[R]):
    """Recordings of one kind: how they become trials, and which effects they may show."""

    effects: tuple[Effect[Any], ...]
    elsewhere: ClassVar[dict[str, str]]  # families of such a system that these recordings never show, and why
    shown_by: str  # what is recorded, as it is spoken
    nothing: str  # why recordings without any channel cannot be used
    half_names: ClassVar[tuple[str, str]] = ("first half", "second half")
    chance: ClassVar[float] = 0.0  # of a false name, as in `SelectionSettings`; 0 unless noise is calibrated

    @abstractmethod
    def alike(self, recordings: Sequence[R]) -> tuple[list[R], list[str]]:
        """The recordings reduced to what all of them carry, with notes. Raises `InputError`."""

    def usable(self, fit: Sequence[R], held_out: Sequence[R]) -> tuple[Sequence[R], Sequence[R], list[str]]:
        """Those that tell the same as the fitted ones, with a note for each that is left out."""
        return fit, held_out, []

    @abstractmethod
    def trials(self, fit: Sequence[R], held_out: Sequence[R]) -> tuple[list[Observed], list[Observed]]:
        """Residuals of fitted and held-out recordings. Raises `InputError`."""

    def why_nothing(self, trials: Sequence[Observed]) -> str:
        """Why these trials, which have no channel, cannot be used."""
        return self.nothing

    @abstractmethod
    def system(self, trial: Observed) -> str:
        """Name of the diagnosed system, as the report shows it: an arm's role, a camera."""

    @abstractmethod
    def cut(self, recording: R) -> tuple[R, R]:
        """Two parts of about the same size, which `half_names` tells apart. Raises `InputError`."""

    def halves(self, recording: R) -> tuple[R, R]:
        """Both parts of a recording, each with a name of its own. Raises `InputError`."""
        (one, other), (a, b) = self.cut(recording), self.half_names
        name = recording.name
        return replace(one, name=f"{name}, {a}"), replace(other, name=f"{name}, {b}")

    @abstractmethod
    def next_experiment(
        self, likelihood: Likelihood, fits: Sequence[Fit], names: Sequence[str], seed: int
    ) -> tuple[NextExperiment | None, str]:
        """The recording that would split the named effects, and why there is none where there is none."""

    def doubts(self, evidence: Evidence, chosen: Fit | None, least: float) -> list[str]:
        """Known causes that are no effect of the library and explain more than what was chosen, in words.

        `least` [nat] is what an effect needs against nothing.
        """
        return []

    def doubts_of(self, fitted: Likelihood, held_out: Likelihood) -> Doubts:
        """`doubts` of these recordings, with what they share evaluated once."""
        return self.doubts

    def notes(self, trials: Sequence[Observed]) -> list[str]:
        """Remarks about the input that only residuals show."""
        return []

    def misdescription(self, trials: Sequence[Observed]) -> WrongDescription | None:
        """An error of the description that must be corrected first."""
        return None

    def curve(self, evidence: Evidence, chosen: Fit, index: int) -> Curve | None:
        """A named effect over the data."""
        return None

    def correction(
        self, evidence: Evidence, chosen: Fit, far: HowFar, sure: bool, rng: np.random.Generator
    ) -> Correction | Recalibration | None:
        """What was named as a change of the model, for exports, or of a calibration, to be applied.

        `sure` is false while other effects fit as well. None where nothing can be made of it.
        """
        return None

    def information(self, likelihood: Likelihood, fit: Fit) -> dict[str, dict[str, float]]:
        """Least standard deviation of each parameter by effect that noise allows, were all else as stated."""
        return {}

    def show_sooner(self, evidence: Evidence, pool: Sequence[Hypothesis], needed: float) -> list[str]:
        """What other recordings would show of effects that these pass, where nothing was found.

        Args:
            evidence: of the fitted recordings.
            pool: every effect at every place, form and shape that these can show.
            needed: log evidence that a name needs [nat].
        """
        return []

    def finish(self, diagnosis: Diagnosis, trial: Observed) -> Diagnosis:
        """The report in the units of this system."""
        return diagnosis
