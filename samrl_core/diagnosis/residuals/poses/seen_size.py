"""Whether a chain of poses closes once what is seen is of another size: a tag's size typed in wrongly.

A detector that is told a wrong size gives every position by one factor. No transform makes up for it; where
none is stated nothing else contradicts it: the chain stays open, and its opening looks like noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from samrl_core.cell.types.pose_recording import PoseRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.residuals.poses.chain import Chain, Constants, used_links
from samrl_core.diagnosis.residuals.poses.solve import closing_error, solved

ROUGH_M = 0.003  # that a chain stays open by, from which on sizes are tried
OPEN_M = 0.01  # beyond it no detector is so rough, unless its stated errors are
STATED = 10.0  # times the stated lasting errors of the detector, likewise
CLEARLY = 2.5  # times closer than as it is: that is no noise
LEAST = 0.03  # relative, of a size that is told
_SETTLED, _ROUNDS = 0.005, 8  # relative change of the factor, and rounds until it
_ROBUST_ROUNDS, _MOST_VIEWS = 5, 80


@dataclass(frozen=True)
class SeenSize:
    """A size at which the chain closes."""

    factor: float  # by which seen positions have to be multiplied
    closes_m: float


def find_seen_size(recording: PoseRecording, closes_m: float) -> SeenSize | None:
    """The factor of the seen positions that closes the chain clearly better; None where none does.

    Turns do not depend on a size: they are solved for first, and translations and the factor then are linear.

    Args:
        recording: as described, whose transforms are solved for.
        closes_m: to which it closes as it is [m].
    """
    if closes_m < ROUGH_M:
        return None
    factor = 1.0
    try:
        for _ in range(_ROUNDS):
            more = _linear_factor(_scaled(recording, factor))
            if not 0.0 < more * factor < np.inf:
                return None
            factor *= more
            if abs(more - 1.0) < _SETTLED:
                break
        left = closing_error(_scaled(recording, factor))
    except InputError:
        return None
    return SeenSize(factor, left) if abs(factor - 1.0) > LEAST and left < closes_m / CLEARLY else None


def best_size(described: Sequence[tuple[PoseRecording, float]]) -> tuple[SeenSize | None, int]:
    """The size that closes a chain best, and the number of its description; None, 0 where none is told.

    Args:
        described: recordings by likely descriptions, the best first, and to what they close [m].
    """
    if described[0][1] < ROUGH_M:
        return None, 0
    sizes = [find_seen_size(recording, closes_m) for recording, closes_m in described]
    told = [(size.closes_m, k) for k, size in enumerate(sizes) if size is not None]
    number = min(told)[1] if told else 0
    return sizes[number], number


def size_note(recording: PoseRecording) -> str:
    """What is said of a chain of which nothing is stated and that another size closes; empty of any other."""
    if (closed := _closed(recording)) is None or (size := closed[1]) is None:
        return ""
    return (
        f"nothing is stated, and the chain stays open by {1e3 * closed[0]:.1f} mm; it closes to"
        f" {1e3 * size.closes_m:.1f} mm with a target of {size.factor:.2f} times the size that its detector"
        " was told. Correct the poses that it gave: until then no gap means that they are rough"
    )


def find_opening(recording: PoseRecording) -> str:
    """Why a chain of which nothing is stated has a gap, in words; empty where it closes, or of any other.

    What no transform closes is in no residual: all of it looks like a detector's noise.
    """
    if (closed := _closed(recording)) is None:
        return ""
    closes_m, size = closed
    limit_m = max(OPEN_M, STATED * recording.tolerances.detection_position)
    if size is None and closes_m < limit_m:
        return ""
    opening = f"{recording.name}: no transforms close the chain: it stays open by {1e3 * closes_m:.1f} mm"
    if size is None:
        return (
            f"{opening}, limit {1e3 * limit_m:.1f} mm; look for poses of another target, a clock, an arm's"
            " model, or state as `detection_position` how rough the detector is"
        )
    return (
        f"{opening}, and by {1e3 * size.closes_m:.1f} mm with a target of {size.factor:.2f} times the size"
        " that its detector was told; correct the poses that it gave"
    )


def _closed(recording: PoseRecording) -> tuple[float, SeenSize | None] | None:
    """To what a chain closes [m], and the size that closes it better; None where anything is stated.

    What is stated contradicts a wrong size, which is then diagnosed.
    """
    if Constants.stated(recording).free != set(used_links(recording)):
        return None
    try:
        closes_m = closing_error(_scaled(recording, 1.0))
    except InputError:
        return None
    return closes_m, find_seen_size(recording, closes_m)


def _scaled(recording: PoseRecording, factor: float) -> PoseRecording:
    """Some of the views, as far away as another size makes them."""
    seen, step = recording.seen, -(-len(recording.seen.time) // _MOST_VIEWS)
    position = factor * seen.position[::step]
    return replace(recording, seen=type(seen)(seen.time[::step], position, seen.quat_xyzw[::step]))


def _linear_factor(recording: PoseRecording) -> float:
    """The factor of the seen positions, by robust least squares over it and the free translations."""
    constants, _ = solved([recording])
    chain = Chain(recording, constants)
    expected = chain.predicted((0.0, 0.0))[:, :3, 3]
    columns = []
    for name in sorted(constants.free):
        for axis in range(3):
            moved = getattr(constants, name).copy()
            moved[axis, 3] += 1.0
            chain.constants = replace(constants, **{name: moved})
            columns.append((chain.predicted((0.0, 0.0))[:, :3, 3] - expected).reshape(-1))
    seen = chain.seen[:, :3, 3]
    design = np.stack([seen.reshape(-1), *(-column for column in columns)], axis=1)
    weight = np.ones(len(seen))
    for _ in range(_ROBUST_ROUNDS):
        root = np.repeat(weight, 3)
        found = np.linalg.lstsq(root[:, None] * design, root * expected.reshape(-1), rcond=1e-9)[0]
        left = np.linalg.norm((design @ found - expected.reshape(-1)).reshape(-1, 3), axis=1)
        weight = 1.0 / np.sqrt(1.0 + (left / max(float(np.median(left)), 1e-9)) ** 2)
    return float(found[0])
