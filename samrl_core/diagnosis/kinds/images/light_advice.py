"""From which size on a lamp is named in other recordings, where these pass it.

A brightness is light times paint: with all colours free no image tells one from the other, and what tells
light from paint is how far paint may be off. So recordings of a surface whose colour is known show a lamp
sooner, other views of the same surfaces do not.
"""

from __future__ import annotations

import math
from copy import copy
from dataclasses import replace

from samrl_core.diagnosis.effects.images.lighting import EFFECT
from samrl_core.diagnosis.residuals.images.image_trial import ImageTrial
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.result import LeastSize
from samrl_core.diagnosis.selection.hypothesis import Evidence
from samrl_core.diagnosis.verdict.least_sizes import least_sizes

CARD = 0.05  # half width of a reference card's grey, and of how well it is lit from where lamps stand
LOCKED = 0.05  # likewise of exposure and lamps that are as the description has them


def advise_on_light(evidence: Evidence, needed: float) -> list[str]:
    """A sentence with sizes [share of the light] as recorded, with a card, and with exposure locked too.

    Args:
        evidence: of fitted recordings.
        needed: log evidence that a name needs [nat].
    """
    trial = evidence.likelihood.trials[0]
    assert isinstance(trial, ImageTrial)
    grey = trial.constants.scene.table_grey
    now, card, locked = (
        light_seen_from(evidence, needed, **known)
        for known in ({}, {"table_paint": CARD}, {"table_paint": CARD, "brightness": LOCKED})
    )
    if now is None or card is None or locked is None:
        return []
    return [
        f"a lamp or an exposure is named from {_ends(now)} on: whatever the views, what paint may be off by"
        f" passes for light; around the object a matt card of the table's drawn grey ({grey:.2f} of white;"
        f" table_paint: {CARD:g} in --tolerances) shows it from {_ends(card)} on, with exposure and lamps"
        f" locked as well (brightness: {LOCKED:g}) from {_ends(locked)} on"
    ]


def light_seen_from(evidence: Evidence, needed: float, **known: float) -> LeastSize | None:
    """The least size of a light that is named, some tolerances other than stated; None without colours."""
    trials = []
    for trial in evidence.likelihood.trials:
        assert isinstance(trial, ImageTrial)
        other = copy(trial)
        other.recording = replace(trial.recording, tolerances=replace(trial.recording.tolerances, **known))
        other.cached = {}
        trials.append(other)
    there = Evidence(Likelihood(trials), evidence.correlation_time)
    found = least_sizes(there, there.screen([EFFECT]), needed)
    return found[0] if found else None


def _ends(one: LeastSize) -> str:
    low, high = one.stated
    shown = [f"{end:+.0%}" for end in (low, high) if math.isfinite(end)]  # no light is weaker than none
    return " or ".join(shown) if shown else "no size"
