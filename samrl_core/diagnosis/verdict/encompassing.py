"""Whether recordings lie at one of two explanations, and not between them or beyond.

Along the difference of what two sets predict, p and p', the data are p + t (p' - p) + noise: t is zero where
the first is true and one where the second is (J test: Davidson and MacKinnon 1981, Econometrica 49;
encompassing: Mizon and Richard 1986, Econometrica 54). Where neither formula is the thing itself, t lies
elsewhere, and elsewhere in each recording: then evidence between the two is the error of both. Where it is
zero in each, unseen ones included, evidence counts, however small a share it is of what both explain.
"""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.hypothesis import Fit
from samrl_core.diagnosis.selection.on_held_out import held_out_remainder
from samrl_core.diagnosis.selection.selection import Selection
from samrl_core.diagnosis.verdict.foretelling import MOST, TOLD

BESIDE = 0.2  # of the difference of two predictions, by which the truth may lie beside one of them
SURELY = 2.0  # standard deviations
MIDDLE = 0.5  # from here on the rival is nearer


def find_told_apart(fitted: Likelihood, held_out: Likelihood, selection: Selection) -> list[Fit]:
    """Rivals of which each recording, also those never fitted, says that the chosen set is meant.

    Geometry is exact, and chance does not strike twice alike: nobody is compared then.
    """
    chosen = selection.chosen
    if chosen is None or fitted.exact or not held_out.blocks:
        return []
    first = chosen.hypotheses[0]
    rivals = [
        r
        for r in selection.rivals[:MOST]
        if np.isfinite(r.log_evidence) and r.log_evidence < chosen.log_evidence
    ]
    if any(h.effect.by_chance for fit in (chosen, *rivals) for h in fit.hypotheses):
        return []
    k = selection.correlation_time
    return [
        r
        for r in rivals
        if r.hypotheses[0].name != first.name
        and lies_at_first(fitted, chosen, r, k)
        and lies_at_first(held_out, chosen, r, k)
    ]


def lies_at_first(likelihood: Likelihood, first: Fit, second: Fit, correlation: float) -> bool:
    """Whether recordings, all together and each, lie at one of two fits along the way to the other.

    Together they must tell that for sure; a recording in which both foretell nearly the same may say nothing.

    Args:
        likelihood: of the recordings; fits of others are taken as they are.
        first: the fit that may be meant.
        second: the other one.
        correlation: samples that count as one.
    """
    moments, lengths, whole = _along(likelihood, first, second, correlation)
    if whole < 2.0 * TOLD:
        return False
    place, deviation = float(np.sum(moments)) / whole, whole**-0.5
    if abs(place) > BESIDE or place + SURELY * deviation > MIDDLE:
        return False
    tells = lengths >= 2.0 * TOLD
    each = moments[tells] / lengths[tells]
    return bool(np.all(np.abs(each) <= BESIDE + SURELY / np.sqrt(lengths[tells])))


def why_tied(fitted: Likelihood, held_out: Likelihood, selection: Selection, rival: str) -> str:
    """Why recordings do not tell the chosen set from a rival, `family@place`; empty if they cannot say."""
    chosen = selection.chosen
    other = next((r for r in selection.rivals if r.hypotheses[0].name == rival), None)
    if chosen is None or other is None or fitted.exact:
        return ""
    if any(h.effect.by_chance for fit in (chosen, other) for h in fit.hypotheses):
        return ""
    parts = [_along(x, chosen, other, selection.correlation_time) for x in (fitted, held_out) if x.blocks]
    whole = sum(part[2] for part in parts)
    name = chosen.hypotheses[0].name
    if whole < 2.0 * TOLD:
        return (
            f"{name} and {rival} foretell all of these recordings alike: were one true, it would win"
            f" {0.5 * whole:.1f} of log likelihood over the other, and {TOLD:.1f} are needed"
        )
    place = sum(float(np.sum(part[0])) for part in parts) / whole
    return f"recordings lie at {place:.2f} of the way from {name} (0) to {rival} (1)"


def _along(
    likelihood: Likelihood, first: Fit, second: Fit, correlation: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Of each recording, how far it lies along the way from one fit to the other, times the way's square.

    Returns:
        Those moments (R,), squared lengths (R,) of the way in each recording, and that of the whole way: the
        first, if true, is expected to win half of it [nat] over the second.
    """
    rest = held_out_remainder(likelihood, first)
    way = rest - held_out_remainder(likelihood, second)
    recording = np.zeros(len(way), dtype=int)
    for (r, _, _), part in likelihood.blocks.items():
        recording[part] = r
    moments, gram = likelihood.by_group(way, recording, len(likelihood.trials), rest, correlation)
    return moments, np.diag(gram), float(np.sum(gram))
