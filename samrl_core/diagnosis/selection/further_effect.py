"""When one more effect is believed beside those that were found."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit
from samrl_core.diagnosis.selection.on_held_out import are_denied, gains, held_out_gains, held_out_remainder
from samrl_core.diagnosis.selection.settings import SelectionSettings
from samrl_core.diagnosis.selection.twins import does_the_same


def is_worth(
    evidence: Evidence,
    held_out: Likelihood,
    narrow: Fit,
    held_left: np.ndarray,
    wide: Fit,
    settings: SelectionSettings,
) -> bool:
    """A further effect must be significant, matter on fitted data, and help on data that were not fitted.

    Mending there what the narrower set spoiled is no help: both together must then win something.

    `held_left` (N,) is what the narrower set leaves of those.
    """
    if wide.log_evidence - narrow.log_evidence < settings.second_threshold:
        return False
    k = evidence.correlation_time
    likelihood = evidence.likelihood
    remainder_narrow, remainder_wide = evidence.remainder(narrow), evidence.remainder(wide)
    added = wide.hypotheses[-1]
    there = set(added.regressors.blocks)
    # Where it acts, the further effect must explain most of what is left, or much of what there ever was:
    # it may be small beside the first, but it must not merely mend the first one's formula.
    before = likelihood.deficit(remainder_narrow, k, there)
    after = likelihood.deficit(remainder_wide, k, there)
    at_all = likelihood.deficit(likelihood.y, k, there)
    # A weak effect may stay below one standard deviation per sample: then its evidence says what it explains.
    explained = max(before - after, wide.log_evidence - narrow.log_evidence)
    # One family at every joint of an arm mends nothing: it is what arms have.
    common = added.place.startswith("arm:") and added.effect.at_every_joint
    mends = before < settings.local_remainder * at_all and not common
    same = {b[1:] for b in there} <= {b[1:] for h in narrow.hypotheses for b in h.regressors.blocks}
    # Geometry is exact: there is no formula to mend, and two errors of one chain act on all its channels.
    if likelihood.exact:
        if any(does_the_same(likelihood, added, h) for h in narrow.hypotheses):
            return False
    else:
        if same and not common and explained < settings.same_share * at_all:
            return False
        share = 0.9 if mends else 0.5 * settings.local_share if common else settings.local_share
        if explained < share * before:
            return False
    known = _known(held_out, there)
    held_before = held_out.deficit(held_left, k, known)
    held_wide = held_out_remainder(held_out, wide)
    if held_out.deficit(held_wide, k, known) > (1.0 - settings.held_out_share) * held_before:
        return False
    if any(h.effect.by_chance for h in wide.hypotheses):
        return True  # when chance strikes again, nothing that was fitted can say
    # Where they hold nothing beyond noise, nothing is left to remove: within the noise it must win, too.
    won, expected = gains(held_out, held_left - held_wide, held_left, k)
    if are_denied(won, expected, settings.held_out_share):
        return False
    return held_out_gains(held_out, narrow, k)[0] >= 0.0 or held_out_gains(held_out, wide, k)[0] >= 0.0


def _known(held_out: Likelihood, blocks: set[tuple[int, str, int]]) -> set[tuple[int, str, int]]:
    """The same channels and joints on held-out recordings."""
    pairs = {(channel, joint) for _, channel, joint in blocks}
    return {block for block in held_out.blocks if block[1:] in pairs}
