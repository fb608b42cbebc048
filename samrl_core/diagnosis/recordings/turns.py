"""Angles that wrap around: a full turn from one sample to the next, while the joint goes on as before."""

from __future__ import annotations

import numpy as np

_MOST_JUMPS = 0.1  # of the steps: an angle that jumps more often moves too fast for its rate to be followed
_GOES_ON = 2.0  # times the fastest other step: what is left of a jump, once the turn is taken out
_WITHIN = 1.02  # turns over which an angle that wraps spans at most
_LEAST_LEFT = 0.05  # turns: what is left of a jump of a joint that is nearly at rest


def find_wraps(angles: np.ndarray, turn: float) -> np.ndarray:
    """Steps at which an angle jumps by a turn.

    Args:
        angles: of one joint, (N,), finite.
        turn: of the unit they are in: 2 pi, 360, counts per turn.

    Returns:
        Indices of the samples before the jumps; none where the angle does not wrap.
    """
    steps = np.diff(angles)
    jumps = np.abs(steps) > 0.5 * turn
    if not jumps.any() or jumps.mean() > _MOST_JUMPS or np.ptp(angles) > _WITHIN * turn:
        return np.array([], dtype=int)
    left = np.abs(np.abs(steps[jumps]) - turn)
    fast = float(np.abs(steps[~jumps]).max(initial=0.0))
    if left.max() > max(_GOES_ON * fast, _LEAST_LEFT * turn):
        return np.array([], dtype=int)
    return np.flatnonzero(jumps)
