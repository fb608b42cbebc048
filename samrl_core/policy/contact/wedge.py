"""A peg that leans against its hole: what turns it, though actions do not turn the hand.

Two walls push it from opposite sides, at the mouth and at its end. Their forces cancel, so that little is felt
sideways while each grows; what is left is a moment about the end and friction along the axis (Whitney 1982,
"Quasi-Static Assembly of Compliantly Supported Rigid Parts", the wedged and the jammed peg). To press harder, or
to follow what little is felt sideways, wedges it more.

An arm whose joints yield has its compliance centre far above the tip, so that a force at the tip turns the
peg: some 3 mrad per newton here, against 10 mrad for a newton metre, which walls 15 mm apart make of 130 N in
all. Moved aside until the force at its end turns it as far as the walls did, the peg touches one of them.
"""

from __future__ import annotations

import numpy as np

from samrl_core.policy.contact.tip_sense import TipReading


def turning_force(
    reading: TipReading, pushed: np.ndarray, twisted: np.ndarray, most: float
) -> np.ndarray:
    """Sideways push at the tip alone (2,) [N] that turns the peg as all that is felt does.

    Args:
        reading: of the tip at rest.
        pushed: (3,) by the block [N].
        twisted: (3,) by the block about the tip [N m].
        most: what is asked for at most [N].
    """
    turn = reading.turning[:2]
    about = turn[:, :3] @ pushed + turn[:, 3:5] @ twisted[:2]
    sideways = turn[:, :2]
    if not abs(float(np.linalg.det(sideways))) > 0.0:
        return np.zeros(2)  # an arm that a force at its tip does not turn
    force = np.linalg.solve(sideways, about)
    return force * min(1.0, most / max(float(np.linalg.norm(force)), 1e-12))


def towards(
    reading: TipReading, pushed: np.ndarray, twisted: np.ndarray, wanted: np.ndarray
) -> np.ndarray:
    """Displacement (3,) of the commanded tip [m] after which the block pushes as `wanted` (3,) [N], without a
    moment, if the peg stays where it is.
    """
    shift = reading.turning.T  # of the tip by a moment, as a compliance is symmetric
    return reading.compliance @ (pushed - wanted) + shift[:3, :2] @ twisted[:2]
