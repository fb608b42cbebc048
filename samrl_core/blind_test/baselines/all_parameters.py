"""All parameters fitted at once and ranked by size over range, as whole-model identification does (PACE)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.blind_test.baselines.candidates import MIDDLE_DELAY, candidates, whitened
from samrl_core.blind_test.baselines.claim import NOTHING, Claim
from samrl_core.blind_test.baselines.normal_equations import normal_equations
from samrl_core.blind_test.baselines.samples import make_samples
from samrl_core.cell.types.arm_recording import ArmRecording

SMALLEST = 0.1  # of the range; below it nothing is named (lowest severity of the protocol)


def all_parameters(fit: Sequence[ArmRecording]) -> Claim:
    """One linear fit of everything; the largest share of its range is named."""
    s = make_samples(fit, MIDDLE_DELAY)
    library = list(candidates(s, MIDDLE_DELAY))
    equations = normal_equations(s, library, whitened(s), np.ones(len(s.time), bool))
    theta = np.abs(equations.solve(np.ones(len(equations.owner), bool)))
    largest = int(np.argmax(theta))
    if theta[largest] < SMALLEST:
        return NOTHING
    c = library[equations.owner[largest]]
    return Claim(c.family, c.place, float(theta[largest]))
