"""What acts on bodies and is no effect of the library: it must not pass under another name."""

from __future__ import annotations

from samrl_core.diagnosis.effects.body_forms import OfMotion
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.kinds.suspects import Suspect, explained, strongest
from samrl_core.diagnosis.residuals.bodies.body_trial import BodyTrial
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit

PATTERN = 80.0  # [nat] beyond noise and tolerances, of which something is there whatever it is
SLOW = 6.0  # samples that count as one there: whatever lasts as long as a motion is none of the noise
SPREAD = 0.1  # of a suspect's size before any data, in the units of its column


class BodySuspect(Suspect[BodyTrial]):
    """Forces of `BodyTrial.suspects`."""

    acts_on = "contact"

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
    found = explained(evidence, BodySuspect(), trial)
    if chosen is None:
        excess = evidence.likelihood.deficit(evidence.likelihood.y, SLOW)
        if excess > PATTERN:
            found.append((excess, "something that is no effect"))
    return strongest(found, chosen, least, "")
