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

from samrl_core.policy.contact.tip_sense import TipReading


@dataclass(frozen=True)
class TurningSettings:
    """Forces and steps."""

    first: float = 6.0  # sideways force that is tried first, and by which it changes in an action [N]
    more: float = 3.0  # added where the peg rubs on [N]
    most: float = 15.0  # [N]
    rubs: float = 1.0  # force along the axis from which on walls rub [N]
    presses: float = 1.0  # beyond its own friction from which on the peg leans more than it is turned [N]
    jams: float = 4.0  # from which on it is backed off even so [N]
    spare: float = 8.0  # so much more than asked for is left [N]
    worse: float = 0.5  # more than before, beyond its own friction, shows the wrong way [N]
    sinks: float = 0.3  # of what was asked for; a peg that sinks by less is held by two walls [-]
    friction: float = 0.3  # of peg and hole, as drawn [-]
    back: float = 0.001  # so far it is backed off [m]
    step: float = 0.0015  # and lowered, while it rubs [m]
    long_step: float = 0.002  # the same while it does not [m]


@dataclass(frozen=True)
class Turning:
    """How a peg that leans is turned."""

    force: float  # of the walls on its end along the axis that turns most, sign included [N]
    wanted: float  # the same, that actions lead to [N]
    before: float  # force along the hole's axis when that was chosen [N]
    tries: int = 1  # of directions
    backed_off: bool = True  # with the last action


def turning_axis(reading: TipReading) -> np.ndarray:
    """Direction (2,) in which a way of the commanded tip turns a peg most, held at its end."""
    yields = np.diag(reading.compliance)[:2]
    turn = np.linalg.norm(reading.turning[:2, :2], axis=0) / np.maximum(yields, 1e-12)
    return np.eye(2)[int(np.argmax(turn))]


def begun(reading: TipReading, up: float, lean: np.ndarray, s: TurningSettings) -> Turning:
    """The first try: towards where images have the hole lean (2,), see `Mouth`."""
    turned = reading.turning[:2, :2] @ turning_axis(reading)
    towards = float(turned @ np.array([-lean[1], lean[0]]))
    force = s.first if towards >= 0.0 else -s.first
    return Turning(force, force, up)


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
        return replace(t, force=_nearer(t.force, t.wanted, s.first)), 0.0
    if t.backed_off:
        return replace(t, backed_off=False), s.back + 0.5 * s.step
    rubs = beyond_one_wall(pushed, s.friction)
    held = sank < s.sinks
    if t.tries == 1 and (held or rubs > t.before + s.worse):
        return Turning(0.0, -t.force, rubs, 2), -s.back
    if (held or rubs > s.presses) and abs(t.force) < s.most:
        more = float(np.copysign(min(abs(t.force) + s.more, s.most), t.force))
        return Turning(more, more, rubs, 2), -s.back
    if rubs > s.jams:
        return replace(t, tries=2, backed_off=True), -s.back
    return replace(t, tries=2), s.step if rubs > 0.0 else s.long_step


def missing_force(turning: Turning, pushed: float, s: TurningSettings) -> float:
    """What is to be added [N] to a push along the axis [N]; what it is more, up to `spare`, is left."""
    missing = turning.force - pushed
    if turning.force == 0.0 or missing * turning.force >= 0.0:
        return missing
    return min(missing + s.spare, 0.0) if missing < 0.0 else max(missing - s.spare, 0.0)


def beyond_one_wall(pushed: np.ndarray, friction: float) -> float:
    """Force along the axis [N] that the sideways push (3,) [N] does not explain: two walls push."""
    return float(pushed[2]) - friction * float(np.linalg.norm(pushed[:2]))


def _nearer(force: float, wanted: float, most: float) -> float:
    return force + float(np.clip(wanted - force, -most, most))
