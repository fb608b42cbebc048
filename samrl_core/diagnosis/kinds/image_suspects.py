"""What shows in images and is no effect of the library: it passes under no other name, nor as no gap."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.effects.image_forms import ImageColumns
from samrl_core.diagnosis.residuals.images.image_trial import ImageTrial
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, hypothesis

CLEARLY = 5.0  # [nat] by which a suspect must explain more than what was named
BESIDE = 12.0  # [nat] that it needs where nothing was named
# In words, the columns that it is made of, and standard deviations of its amplitudes before any data.
SUSPECTS: tuple[tuple[str, tuple[str, ...], tuple[float, ...]], ...] = (
    ("the tool sits elsewhere in the hand", ("held",), (*(0.005,) * 3, *(0.02,) * 3)),
    ("masks are larger or smaller than what they show", ("outline_object", "outline_tip"), (2.0, 2.0)),
    ("depth lies beside colour", ("depth_shift",), (0.02, 0.02)),
)


class ImageSuspect(Effect[ImageTrial]):
    """No family of the contract: never named, only weighed against what is."""

    family, number, title = "suspect", 0, "Something else"
    meaning = remedy = formula = source = excitation = "-"
    acts_on = "reading"
    parameters: ClassVar = ()

    def forms(self, trial: ImageTrial, place: Place) -> tuple[Form[ImageTrial], ...]:
        return tuple(
            ImageColumns(
                name=words, place=place, amplitudes=tuple("abcdef"[: len(spreads)]), columns_of=names,
                spreads=spreads,
            )
            for words, names, spreads in SUSPECTS
        )  # fmt: skip


def image_suspicions(evidence: Evidence, chosen: Fit | None, least: float) -> list[str]:
    """The suspect that explains the images better than what was chosen, or than nothing, in words."""
    trial = evidence.likelihood.trials[0]
    assert isinstance(trial, ImageTrial)
    suspect = ImageSuspect()
    found: list[tuple[float, str]] = []
    for form in suspect.forms(trial, Place.find(trial, trial.places[0])):
        for shape in form.shapes:
            made = hypothesis(evidence.likelihood, suspect, form, shape)
            if made is not None:
                found.append((evidence.fit([made]).log_evidence, form.name))
    gain, name = max(found, default=(-np.inf, ""))
    named = 0.0 if chosen is None else chosen.log_evidence
    if gain < (max(BESIDE, least) if chosen is None else named + CLEARLY):
        return []
    than = "nothing else does" if chosen is None else f"what can be named explains {named:.0f}"
    return [f"{name}: that explains {gain:.0f} of log evidence, {than}; it is no effect of the library"]
