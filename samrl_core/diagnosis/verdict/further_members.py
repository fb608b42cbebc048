"""Further members of a set that is named, for which nothing certain speaks.

Evidence takes formulas as exact. A thousandth of a large effect is worth much of it, and may be what the
first one's formula leaves: a payload of -12 +- 20 g and a rotor's inertia beside a servo's gain that was off
by half.
"""

from __future__ import annotations

from collections.abc import Sequence

from samrl_core.diagnosis.result import NamedEffect
from samrl_core.diagnosis.selection.hypothesis import Hypothesis
from samrl_core.diagnosis.selection.selection import Selection
from samrl_core.diagnosis.verdict.how_far import HowFar

HARDLY_ANY = 0.05  # of the torque, fitted and held out, that a set leaves which explains the whole of it
TOGETHER = 0.25  # of the held-out gap that several effects must take off, or a limit beside others


def find_superfluous(selection: Selection, named: Sequence[NamedEffect], far: HowFar) -> tuple[int, ...]:
    """Further members of the chosen set that are to be left out, by their index.

    Their size may be zero, or the gap on recordings never fitted is not smaller for sure with them. A limit
    of the drive fits any torque a little: beside others, as alone, motion must show it. And several effects
    that leave most of the gap share out what one has done that is not among them; but for one that explains
    all of what is seen where it acts (`HowFar.alone`), which nothing else does. Where the whole set leaves
    hardly any torque of unseen recordings, such a one stands unless the gap grows with it for sure: motion
    that a stiff loop holds does not show how strong a drive is.
    """
    assert selection.chosen is not None
    hypotheses = selection.chosen.hypotheses
    members = zip(hypotheses, named, strict=True)
    zero = [k for k, (h, effect) in enumerate(members) if k > 0 and _may_be_zero(h, effect)]
    whole = max(selection.unexplained, selection.held_out_unexplained) < HARDLY_ANY
    sure = far.alone if whole else frozenset()
    idle = [k for k, (low, high) in far.further.items() if (high < 0.0 if k in sure else low <= 0.0)]
    no_limit = [
        k for k, (_, most) in far.further.items() if hypotheses[k].effect.limits_motion and most < TOGETHER
    ]
    little = far.gap is not None and far.gap.shrink is not None and far.gap.shrink < TOGETHER
    shared = set(far.further) - far.alone if little else set()
    return tuple(sorted({*zero, *idle, *no_limit, *shared}))


def _may_be_zero(h: Hypothesis, effect: NamedEffect) -> bool:
    """Whether each size has an interval that holds zero; a shape is none, and never zero."""
    shapes = {*h.shape, *h.effect.renamed_shapes}
    sizes = [p.ci95 for name, p in effect.parameters.items() if name.partition("[")[0] not in shapes]
    return bool(sizes) and all(low <= 0.0 <= high for low, high in sizes)
