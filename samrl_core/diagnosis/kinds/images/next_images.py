"""What would split an ambiguity set of images, from how alike the effects are in the recordings at hand."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, permutations

import numpy as np

from samrl_core.diagnosis.findings.discrimination import find_rivals
from samrl_core.diagnosis.residuals.images.image_trial import ImageTrial
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.result import NextExperiment
from samrl_core.diagnosis.selection.hypothesis import Fit, Hypothesis
from samrl_core.diagnosis.selection.twins import principal_angle


def next_images(
    likelihood: Likelihood, fits: Sequence[Fit], names: Sequence[str]
) -> tuple[NextExperiment | None, str]:
    """No file: a sentence with the smallest angle between the effects, and the views that show each."""
    rivals = {name: h for name, (h, _) in find_rivals(fits, names).items()}
    made = list(rivals.values())
    if len(made) < 2:
        return None, ""
    angle = np.degrees(min(principal_angle(likelihood, a, b) for a, b in combinations(made, 2)))
    trial = likelihood.trials[0]
    assert isinstance(trial, ImageTrial)
    together = f"{' and '.join(rivals)} are {angle:.1f} degrees apart at the closest in these images"
    if _are_one_by_geometry(made, trial):
        return None, (
            f"{together}, and no motion of the camera splits them: a wrong zero of the last joint turns the"
            " camera about its flange as a wrong hand-eye does; correct both as one transform"
        )
    if (split := _by_one_arm(set(rivals), trial)) is not None:
        return None, f"{together}; {split}"
    shown = "; ".join(f"{name}: {h.effect.excitation}" for name, h in rivals.items())
    return None, (
        f"{together}; record views that are chosen to split them (samrl excite --set camera); what shows"
        f" each best: {shown}"
    )


def _by_one_arm(rivals: set[str], trial: ImageTrial) -> str | None:
    """What splits late images from one arm's clock: motion of the other arm, which late images show as well.

    Chosen views are none: where both arms move, latency and the camera arm's clock lie 3 degrees apart.
    """
    late = f"camera_latency@{trial.places[0]}"
    if rivals == {late, "clock_offset@arm:camera_arm"}:
        return (
            "record the tool moving in sight of a camera that stands still: late images show the tool late,"
            " the camera arm's clock does not"
        )
    if rivals == {late, "clock_offset@arm:tool_arm"}:
        return (
            "record the camera moving past what stands still: late images show that late, the tool arm's"
            " clock does not"
        )
    return None


def _are_one_by_geometry(rivals: Sequence[Hypothesis], trial: ImageTrial) -> bool:
    """Whether two effects move the camera alike from wherever it looks."""
    return len(rivals) == 2 and any(a.form.is_done_by(trial, b.name) for a, b in permutations(rivals, 2))
