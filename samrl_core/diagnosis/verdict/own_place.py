"""What a further effect does where it acts, on recordings never fitted."""

from __future__ import annotations

from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.hypothesis import Fit
from samrl_core.diagnosis.selection.on_held_out import held_out_remainder
from samrl_core.diagnosis.selection.selection import Selection

ALL = 0.1  # of what the others leave there, at most, that is left with it
VISIBLE = 25.0  # [nat] that they must leave, for such a share to say something


def explains_its_place(held_out: Likelihood, selection: Selection, without: Fit, member: int) -> bool:
    """Whether recordings never fitted show what a further member does where it acts, and hardly more there.

    A Stribeck friction of a wrist, beside a mount that yields, was all that the wrist's torque had to show:
    of 5711 of log likelihood that unseen recordings held there it left none. The arm's motion, which the
    mount moves, hardly showed it.

    Args:
        held_out: recordings never fitted.
        selection: with the chosen set.
        without: that set without the member, fitted again.
        member: its index.
    """
    chosen, k = selection.chosen, selection.correlation_time
    assert chosen is not None
    acts = {block[1:] for block in chosen.hypotheses[member].regressors.blocks}
    there = {block for block in held_out.blocks if block[1:] in acts}
    before = held_out.deficit(held_out_remainder(held_out, without), k, there)
    after = held_out.deficit(held_out_remainder(held_out, chosen), k, there)
    return before > VISIBLE and after < ALL * before
