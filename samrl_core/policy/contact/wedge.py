"""A peg that leans against its hole: what turns it, though actions do not turn the hand.

Two walls push it from opposite sides, at the mouth and at its end (Whitney 1982, "Quasi-Static Assembly of
Compliantly Supported Rigid Parts": the wedged peg). Their forces cancel: sideways nothing is felt while each
grows, and their moment is less than what rubs in joints that stand still. Friction along the axis tells that
they push, not which way the peg leans. To press on wedges it more.

An arm whose joints yield has its compliance centre far above the tip, so that a force at the tip turns the
peg: 3 mrad for each newton forwards or backwards. So it is backed off, pushed sideways and lowered again; if
that rubs more than before, it leans the other way.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from samrl_core.cell.control.tip_sense import TipReading


@dataclass(frozen=True)
class TurningSettings:
    """Forces and steps."""

    first: float = 6.0  # sideways force that is tried first, and by which it changes in an action [N]
    more: float = 3.0  # added where the peg rubs on [N]
    most: float = 15.0  # [N]
    # Force beyond one wall's from which on it is turned [N], where at least so much of the way is left [m].
    rubs: tuple[tuple[float, float], ...] = ((1.0, 0.008), (2.5, 0.003), (5.0, -1.0))
    presses: float = 1.0  # beyond its own friction from which on the peg leans more than it is turned [N]
    jams: float = 4.0  # from which on it is backed off even so [N]
    spare: float = 8.0  # so much more than asked for is left [N]
    worse: float = 0.5  # more than before, beyond its own friction, shows the wrong way [N]
    sinks: float = 0.3  # of what was asked for; a peg that sinks by less is held by two walls [-]
    sinks_well: float = 0.6  # one that sinks by more is not held [-]
    friction: float = 0.3  # of peg and hole, as drawn [-]
    back: float = 0.001  # so far it is backed off [m]
    step: float = 0.0015  # and lowered, while it rubs [m]
    long_step: float = 0.002  # the same while it does not [m]


@dataclass(frozen=True)
class Turning:
    """How a peg that leans is turned."""

    force: float  # of the walls on its end along the axis that turns most, sign included [N]
    wanted: float  # the same, that actions lead to [N]
    change: float  # the next change of that [N]
    before: float  # force along the axis beyond one wall's when it was changed last [N]
    first: bool = True  # whether that was the first change
    new: bool = True  # whether it is still to be judged
    backed_off: bool = True  # with the last action


def turning_axis(reading: TipReading) -> np.ndarray:
    """Direction (2,) in which a way of the commanded tip turns a peg most, held at its end."""
    yields = np.diag(reading.compliance)[:2]
    turn = np.linalg.norm(reading.turning[:2, :2], axis=0) / np.maximum(yields, 1e-12)
    return np.eye(2)[int(np.argmax(turn))]


def leans(rubs: float, left: float, s: TurningSettings) -> bool:
    """Whether a force beyond one wall's [N] is worth a turn where so much of the way is left [m]."""
    return rubs > next(force for force, way in s.rubs if left > way)


def begun(reading: TipReading, rubs: float, lean: np.ndarray, s: TurningSettings) -> Turning:
    """The first try: towards where images have the hole lean (2,), see `Mouth`."""
    turned = reading.turning[:2, :2] @ turning_axis(reading)
    towards = float(turned @ np.array([-lean[1], lean[0]]))
    force = s.first if towards >= 0.0 else -s.first
    return Turning(force, force, float(np.copysign(s.more, force)), rubs)


def turned_on(turning: Turning, pushed: np.ndarray, sank: float, s: TurningSettings) -> tuple[Turning, float]:
    """The next state, and by how much the peg is lowered [m].

    Args:
        turning: the state before.
        pushed: (3,) by the walls [N].
        sank: share of the last way down that the peg went [-].
        s: forces and steps.
    """
    t = turning
    if t.force != t.wanted:
        return replace(t, force=t.force + float(np.clip(t.wanted - t.force, -s.first, s.first))), 0.0
    if t.backed_off:
        return replace(t, backed_off=False), s.back + 0.5 * s.step
    rubs = beyond_one_wall(pushed, s.friction)
    if t.new and sank < s.sinks and rubs <= 0.0:
        return t, s.step  # not pressed enough to tell
    held = sank < s.sinks and rubs > 0.0
    worse = t.new and (held or (rubs > t.before + s.worse and sank < s.sinks_well))
    if worse:
        wanted = -t.force if t.first else t.force - 2.0 * t.change
        force = 0.0 if t.first else t.force - t.change
        return Turning(force, wanted, -t.change, rubs, False), -s.back
    t = replace(t, first=False, new=False)
    if (held or rubs > s.presses) and abs(t.force + t.change) <= s.most:
        force = t.force + t.change
        return replace(t, force=force, wanted=force, before=rubs, new=True, backed_off=True), -s.back
    if rubs > s.jams:
        return replace(t, backed_off=True), -s.back
    return t, s.step if rubs > 0.0 else s.long_step


def missing_force(turning: Turning, pushed: float, s: TurningSettings) -> float:
    """What is to be added [N] to a push along the axis [N]; what it is more, up to `spare`, is left."""
    missing = turning.force - pushed
    if turning.force == 0.0 or missing * turning.force >= 0.0:
        return missing
    return min(missing + s.spare, 0.0) if missing < 0.0 else max(missing - s.spare, 0.0)


def beyond_one_wall(pushed: np.ndarray, friction: float) -> float:
    """Force along the axis [N] that the sideways push (3,) [N] does not explain: two walls push."""
    return float(pushed[2]) - friction * float(np.linalg.norm(pushed[:2]))
