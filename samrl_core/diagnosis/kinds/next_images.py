"""What would split an ambiguity set of images, from how alike the effects are in the recordings at hand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.result import NextExperiment
from samrl_core.diagnosis.selection.hypothesis import Fit, Hypothesis
from samrl_core.diagnosis.selection.twins import principal_angle


def next_images(
    likelihood: Likelihood, fits: Sequence[Fit], names: Sequence[str]
) -> tuple[NextExperiment | None, str]:
    """No file: a sentence with the smallest angle between the effects, and the views that show each."""
    rivals: dict[str, Hypothesis] = {}
    for fit in fits:
        if fit.hypotheses[0].name in names:
            rivals.setdefault(fit.hypotheses[0].name, fit.hypotheses[0])
    made = list(rivals.values())
    pairs = [(a, b) for i, a in enumerate(made) for b in made[i + 1 :]]
    if not pairs:
        return None, ""
    angle = np.degrees(min(principal_angle(likelihood, a, b) for a, b in pairs))
    shown = "; ".join(f"{name}: {h.effect.excitation}" for name, h in rivals.items())
    return None, (
        f"{' and '.join(rivals)} are {angle:.1f} degrees apart at the closest in these images; views that"
        f" show each best: {shown}"
    )
