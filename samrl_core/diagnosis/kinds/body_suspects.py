"""What acts on bodies and is no effect of the library: it must not pass under another name."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from samrl_core.diagnosis.effects.body_forms import OfMotion
from samrl_core.diagnosis.effects.effect import Effect
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.residuals.bodies.body_trial import BodyTrial
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, hypothesis

CLEARLY = 5.0  # [nat] by which a suspect must explain more than what was named
BESIDE = 12.0  # [nat] that it needs where nothing was named
PATTERN = 80.0  # [nat] beyond noise and tolerances, of which something is there whatever it is
SLOW = 6.0  # samples that count as one there: whatever lasts as long as a motion is none of the noise
SPREAD = 0.1  # of a suspect's size before any data, in the units of its column


class Suspect(Effect[BodyTrial]):
    """No family of the contract: never named, only weighed against what is."""

    family, number, title = "suspect", 0, "Something else"
    meaning = remedy = formula = source = excitation = "-"
    acts_on = "contact"
    parameters: ClassVar = ()

    def forms(self, trial: BodyTrial, place: Place) -> tuple[Form[BodyTrial], ...]:
        out = []
        for name, columns in trial.suspects.items():
            freedom = max(len(rows) for rows in columns.values())
            out.append(
                OfMotion(
                    name=name, place=place, amplitudes=tuple("abc"[:freedom]),
                    of=lambda t, name=name: t.suspects.get(name, {}), spreads=(SPREAD,) * freedom,
                )
            )  # fmt: skip
        return tuple(out)


def suspicions(evidence: Evidence, chosen: Fit | None, least: float) -> list[str]:
    """Suspects that explain the recordings better than what was chosen, or than nothing, in words."""
    trial = evidence.likelihood.trials[0]
    assert isinstance(trial, BodyTrial)
    suspect = Suspect()
    found: list[tuple[float, str]] = []
    for form in suspect.forms(trial, Place.find(trial, trial.places[0])):
        for shape in form.shapes:
            made = hypothesis(evidence.likelihood, suspect, form, shape)
            if made is not None:
                found.append((evidence.fit([made]).log_evidence, form.name))
    if chosen is None:
        excess = evidence.likelihood.deficit(evidence.likelihood.y, SLOW)
        if excess > PATTERN:
            found.append((excess, "something that is no effect"))
    gain, name = max(found, default=(-np.inf, ""))
    named = 0.0 if chosen is None else chosen.log_evidence
    if gain < (max(BESIDE, least) if chosen is None else named + CLEARLY):
        return []
    than = "nothing else does" if chosen is None else f"what can be named explains {named:.0f}"
    return [f"{name} explains {gain:.0f} of log evidence, {than}; it is no effect of the library"]
