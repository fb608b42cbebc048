"""Forms of the first effect that recordings cannot tell apart: the form that holds both is reported.

Depth that reads 3 % too far and depth that reads 12 mm too far are one and the same where all that is seen is
at one distance. The effect is certain there, its form is not: a size of one form alone would be wrong at any
other distance, and so would a correction made of it. Sizes of the form that holds both are known together
only, which their covariance says.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit
from samrl_core.diagnosis.selection.selection import Selection, with_chosen
from samrl_core.diagnosis.selection.twins import AS_MUCH, find_misfit, principal_angle


def keep_forms_open(
    likelihood: Likelihood, held_out: Likelihood, selection: Selection
) -> tuple[Selection, tuple[str, ...]]:
    """The selection, its first effect in the form that holds all that explain as much; what is open, in
    words.

    Only fitted recordings count: a form that held-out ones had chosen would not be foretold there. An effect
    says whether its forms may be one (`Effect.forms_may_be_one`): laws of which each is a guess, as of
    friction, are told by evidence.
    """
    chosen = selection.chosen
    if chosen is None or not chosen.hypotheses[0].effect.forms_may_be_one:
        return selection, ()
    evidence = Evidence(likelihood, selection.correlation_time)
    first, *others = chosen.hypotheses
    forms: dict[str, Fit] = {}
    for h in selection.pool:
        if h.name == first.name and h.form.name != first.form.name:
            fit = evidence.fit([h, *others])
            best = forms.get(h.form.name)
            if np.isfinite(fit.log_evidence) and (best is None or fit.log_evidence > best.log_evidence):
                forms[h.form.name] = fit
    most = find_misfit(evidence, chosen) + AS_MUCH
    mine = set(first.form.amplitudes)
    alike = [
        fit
        for fit in forms.values()
        if len(fit.amplitudes[0]) <= len(chosen.amplitudes[0])
        and not mine & set(fit.hypotheses[0].form.amplitudes)
        and find_misfit(evidence, fit) <= most
    ]
    wanted = mine.union(*(fit.hypotheses[0].form.amplitudes for fit in alike))
    whole = [fit for fit in forms.values() if set(fit.hypotheses[0].form.amplitudes) == wanted]
    if not alike or not whole:
        return selection, ()
    both = max(whole, key=lambda fit: fit.log_evidence)
    # The effect is as sure as its best form: that two forms are possible takes nothing from it.
    both = replace(both, log_evidence=max(chosen.log_evidence, both.log_evidence))
    nearest = min(np.degrees(principal_angle(likelihood, first, f.hypotheses[0])) for f in alike)
    names = " and ".join([first.form.name, *(f.hypotheses[0].form.name for f in alike)])
    said = (
        f"{first.name}: {names} explain these recordings alike ({nearest:.0f} degrees apart), and their sizes"
        f" are known together only; what tells them apart: {first.effect.excitation}"
    )
    return with_chosen(likelihood, held_out, selection, both, selection.rivals), (said,)
