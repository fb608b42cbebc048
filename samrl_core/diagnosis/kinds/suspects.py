"""What is no effect of the library and is weighed against those that are: it passes under no other name."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, TypeVar

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect
from samrl_core.diagnosis.effects.form import Place
from samrl_core.diagnosis.residuals.observed import Observed
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, hypothesis

CLEARLY = 5.0  # [nat] by which a suspect must explain more than what was named
BESIDE = 12.0  # [nat] that it needs where nothing was named
T = TypeVar("T", bound=Observed)


class Suspect(Effect[T]):
    """No family of the contract: never named, only weighed against what is. Its forms are the suspects."""

    family, number, title = "suspect", 0, "Something else"
    meaning = remedy = formula = source = excitation = "-"
    parameters: ClassVar = ()


def explained(evidence: Evidence, suspect: Suspect[T], trial: T) -> list[tuple[float, str]]:
    """Log evidence [nat] of each form of a suspect that the recordings can show, and its name."""
    found: list[tuple[float, str]] = []
    for form in suspect.forms(trial, Place.find(trial, trial.places[0])):
        for shape in form.shapes:
            made = hypothesis(evidence.likelihood, suspect, form, shape)
            if made is not None:
                found.append((evidence.fit([made]).log_evidence, form.name))
    return found


def strongest(found: Sequence[tuple[float, str]], chosen: Fit | None, least: float, says: str) -> list[str]:
    """The suspect that explains more than what was chosen, or than nothing, in words; else empty.

    Args:
        found: as of `explained`.
        chosen: what was named.
        least: evidence that anything needs [nat].
        says: between its name and how much it explains.
    """
    gain, name = max(found, default=(-np.inf, ""))
    named = 0.0 if chosen is None else chosen.log_evidence
    if gain < (max(BESIDE, least) if chosen is None else named + CLEARLY):
        return []
    than = "nothing else does" if chosen is None else f"what can be named explains {named:.0f}"
    return [f"{name}{says} explains {gain:.0f} of log evidence, {than}; it is no effect of the library"]
