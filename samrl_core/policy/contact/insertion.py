"""From above a hole to the bottom: touch down gently, search where the peg is stopped, follow the hole.

A peg pressed within a millimetre or so of its hole slips in, because arm and grip give way. What fails is
speed: 5 mm in 0.1 s hit the block with more than the fingers hold, 1 mm with a few newtons. So the tip comes
down in small steps once it is near, and where it is stopped, torques tell, presses at the next likely place
follow (Chhatpar and Branicky 2001, "Search strategies for peg-in-hole assemblies with position uncertainty":
the likely region is covered with probes; here the region is the posterior, and every probe changes it).

Where nobody knows to a millimetre how high the face is, it is felt first, beside the hole: then depths and
what images show of the hole hang on the joints of one arm alone (msgs_docs/decisions/0036).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from samrl_core.cell.control.tip_sense import TipReading
from samrl_core.policy.contact.hole_grid import REACH, Forgiveness, HoleGrid
from samrl_core.policy.contact.wedge import (
    Turning,
    TurningSettings,
    begun,
    beyond_one_wall,
    leans,
    missing_force,
    turned_on,
    turning_axis,
)

BOTTOM = "bottom"  # name of the move that follows once the peg is in
INSIDE = "inside"  # of those that follow the hole
FORCED = "forced"  # the same where it was pressed harder than the task allows
FREE_MOVES = ("feel", "above", "lowering", "look")  # names of the moves with nothing touched
Phase = Literal["feel", "above", "lowering", "search", "inside", "inserted"]


@dataclass(frozen=True)
class InsertionSettings:
    """Steps and forces."""

    known: float = 0.0006  # standard deviation of the face's height from which on it is felt first [m]
    sure: float = 2.5  # so many of them over where the face is expected, steps become slow
    lowest: float = 4.0  # so many of them below, there is no face
    likely: float = 1.25  # so many of them about where it is expected, steps are the slowest
    felt_step: float = 0.0012  # elsewhere; 2 mm in 0.1 s met a face with 39 N, 1.2 mm with 32 N [m]
    slowest_step: float = 0.0008  # down to the face [m]
    least_beside: float = 0.006  # nearer to the hole its face is not felt [m]
    most_beside: float = 0.030  # nor farther from it: a block has an edge [m]
    stopped: float = 0.5  # of the way that was asked for; what sinks by less has met something
    most_stops: int = 1  # in a row that friction in the joints explains: with the next it stands on something
    near: float = 0.003  # above the mouth; from here on in slow steps [m]
    clear: float = 0.0015  # the same above a face that was felt [m]
    aligned: float = 0.0015  # lateral distance from the likeliest place at which it goes down [m]
    slow_step: float = 0.001  # down, until something is touched [m]
    touch: float = 1.8  # vertical force that is a touch [N]
    stopped_touch: float = 1.2  # the same of a tip that was stopped [N]
    side_touch: float = 2.5  # sideways force, of more than which a held peg is relieved [N]
    most_relief: float = 0.003  # of such a push in one action: an arm that springs back drops [m]
    press: float = 2.0  # more force with each action that presses in what sinks, and with the first [N]
    most_press: float = 12.0  # a press stays below, far from what the fingers hold [N]
    slide: float = 3.0  # vertical force while the tip is moved over the face [N]
    side_step: float = 0.0015  # over the face at most [m]
    sinks: float = 0.0001  # a press that takes it lower by more is going in [m]
    way_cost: float = 60.0  # of the way to the next place, in probability per metre [1/m]
    dipped: float = 0.0003  # so much below a felt face a part of the peg's end is in the hole [m]
    entered: float = 0.0012  # so much below the touch the peg is in the hole [m]
    unaided: float = 0.0035  # so much below the believed mouth it is inside though no touch was felt [m]
    unstopped: float = 0.0025  # the same below a face that was felt [m]
    deep_step: float = 0.004  # inside the hole [m]
    smooth: float = 0.5  # vertical force inside below which nothing rubs [N]
    tight_step: float = 0.0015  # where it is more [m]
    turning: TurningSettings = field(default_factory=TurningSettings)
    doubtful: float = 0.010  # so much below a mouth that was never felt it may still be the face [m]
    stuck: float = 5.0  # vertical force that stops it near the mouth: then it is not in the hole [N]
    # Force of both walls for each newton along the axis: friction of 0.3, of which rest leaves half [-].
    walls: float = 6.5
    depth: float = 0.0215  # below the mouth where it ends [m]
    spare_depth: float = 0.003  # deeper at most [m]
    forgiveness: Forgiveness = field(default_factory=Forgiveness)


@dataclass(frozen=True, eq=False)
class Mouth:
    """What is believed of the hole before it is touched."""

    place: np.ndarray  # (2,) middle of the mouth by the tool arm's encoders [m]
    covariance: np.ndarray  # (2, 2) [m2]
    height: float  # by the encoders [m]
    lean: np.ndarray  # (2,) way of the hole's axis in x and y for each metre upwards [-]
    reach: float = REACH  # from its place, within which it is searched [m]
    height_deviation: float = 0.0005  # standard deviation of the height [m]
    beside: np.ndarray | None = None  # (2,) where its face is felt [m]; None: at its place

    @property
    def grid(self) -> HoleGrid:
        """The same as a belief that presses change."""
        return HoleGrid.of(self.place, self.covariance, self.reach)


@dataclass(frozen=True, eq=False)
class Insertion:
    """Where an insertion stands."""

    phase: Phase
    mouth: Mouth
    free_force: np.ndarray  # (3,) reading while nothing is touched [N]
    grid: HoleGrid  # belief of the mouth's place
    touched: float = 0.0  # height of the first touch, and of the mouth once inside [m]
    felt_face: bool = False  # whether that was the block's face
    height: float = 0.0  # of the tip when the last move was chosen [m]
    down: float = 0.0  # that this move asked for [m]
    stops: int = 0  # steps down in a row that were stopped
    pressed: bool = False  # whether it has been pressed onto the block
    turning: Turning | None = None  # of a peg that leans against its hole
    hardest: float = 0.0  # force of face and walls at most, by what was felt at rest so far [N]


@dataclass(frozen=True, eq=False)
class Move:
    """The next action, and the state after it was chosen."""

    name: str  # the phase that asked for it; BOTTOM once the peg is in
    displacement: np.ndarray  # (3,) of the commanded tip [m]
    state: Insertion


def begin(mouth: Mouth, free: TipReading, known: float = InsertionSettings.known) -> Insertion:
    """Above the hole; `free` is what is read of a tip that touches nothing.

    A face whose height is not `known` to a standard deviation [m] is felt first.
    """
    phase: Phase = "feel" if mouth.height_deviation > known else "above"
    return Insertion(phase, mouth, free.force, mouth.grid)


def looked_again(state: Insertion, mouth: Mouth, reading: TipReading) -> Insertion:
    """After another image. In contact images count no more, and once the tip is low no reading is free."""
    if state.phase not in ("feel", "above", "lowering"):
        return state
    if state.phase == "above" and not state.felt_face:
        state = _freer(state, reading)
    return replace(state, mouth=mouth, grid=mouth.grid)


def _freer(state: Insertion, reading: TipReading) -> Insertion:
    """After a reading with nothing touched."""
    return replace(state, free_force=state.free_force + 0.5 * (reading.force - state.free_force))


def next_move(state: Insertion, reading: TipReading, settings: InsertionSettings) -> Move:
    """What the tip does next.

    Args:
        state: of the insertion, after the last move.
        reading: of the tip at rest.
        settings: steps and forces.
    """
    s, pushed = settings, state.free_force - reading.force
    state = _felt(state, reading, s) if state.phase == "feel" else _noticed(state, reading, s)
    if state.phase == "feel":
        move = _feel(state, reading, s)
    elif state.phase == "above":
        move = _above(state, reading, s)
    elif state.phase == "lowering":
        move = _lower(state, reading, pushed, s)
    elif state.phase == "search":
        move = _search(state, reading, pushed, s)
    else:
        move = _follow(state, reading, pushed, s)
    felt = max(state.hardest, _force_on_peg(state.phase, pushed, s))
    asked = replace(move.state, hardest=felt, height=float(reading.tip[2]), down=-float(move.displacement[2]))
    return replace(move, state=asked)


def _felt(state: Insertion, reading: TipReading, s: InsertionSettings) -> Insertion:
    """The state after what is read on the way down beside the hole: a face that stops the tip, or none.

    What rubs in the joints reads like a force. It points against the motion, so that a tip which sinks as it
    is asked to shows what is read with nothing touched, and one that is stopped must read more than that.
    """
    mouth, height = state.mouth, float(reading.tip[2])
    up = float((state.free_force - reading.force)[2])
    sinks = state.height - height > s.stopped * state.down
    state = replace(state, stops=0 if sinks else state.stops + 1)
    if state.down > 0.0 and not sinks and (up > s.stopped_touch or state.stops > s.most_stops):
        known = replace(mouth, height=height, height_deviation=s.known)
        return replace(state, phase="above", mouth=known, touched=height, felt_face=True)
    if height < mouth.height - s.lowest * mouth.height_deviation:
        return replace(state, phase="inside", touched=mouth.height)
    return _freer(state, reading) if sinks else state


def _feel(state: Insertion, reading: TipReading, s: InsertionSettings) -> Move:
    """To where the face may be met first, beside the hole, then down in steps that it stops gently."""
    mouth = state.mouth
    slow = mouth.height + s.sure * mouth.height_deviation
    place = mouth.place if mouth.beside is None else mouth.beside
    way = np.array([*place, slow]) - reading.tip
    beside = s.least_beside < float(np.linalg.norm(mouth.place - reading.tip[:2])) < s.most_beside
    if (beside or mouth.beside is None) and way[2] > -0.5 * s.felt_step:
        likely = abs(float(reading.tip[2]) - mouth.height) < s.likely * mouth.height_deviation
        step = s.slowest_step if likely else s.felt_step
        return Move("feel", np.array([0.0, 0.0, -step]), state)
    return Move("feel", way - [0.0, 0.0, max(way[2], 0.0)], state)


def _noticed(state: Insertion, reading: TipReading, s: InsertionSettings) -> Insertion:
    """The state after what the reading shows: aligned, touched, in the hole, at its bottom."""
    height, place, mouth = float(reading.tip[2]), reading.tip[:2], state.mouth
    pushed = state.free_force - reading.force  # by the block
    up = float(pushed[2])
    near = s.clear if state.felt_face else s.near
    if state.phase == "above":
        low = height < mouth.height + near + 0.5 * s.slow_step
        if low and float(np.linalg.norm(place - mouth.place)) < s.aligned:
            state = replace(state, phase="lowering")
    stopped = state.phase == "lowering" and state.height - height < s.stopped * state.down
    state = replace(state, stops=state.stops + 1 if stopped else 0)
    touches = up > (s.stopped_touch if stopped else s.touch) or state.stops > s.most_stops
    if height < mouth.height + near and touches and (stopped or state.phase == "above"):
        if not (state.felt_face and state.phase == "above"):
            state = replace(state, phase="search", touched=height, felt_face=True)
    unaided = s.unstopped if state.felt_face else s.unaided
    if state.phase == "lowering" and height < mouth.height - unaided:
        state = replace(state, phase="inside", touched=mouth.height)
    if state.phase == "search" and height < state.touched - s.entered:
        state = replace(state, phase="inside")
    elif state.phase == "inside" and up > s.stuck and state.height - height < s.slow_step:
        if not _surely_inside(state, height, s):  # it was not the hole
            state = replace(state, phase="search", touched=height, pressed=False, turning=None)
    if state.phase == "inside" and height < state.touched - s.depth:
        state = replace(state, phase="inserted")
    return state


def _above(state: Insertion, reading: TipReading, s: InsertionSettings) -> Move:
    """Straight to a point near the mouth, off a face that was felt first; the task's own step limits are
    applied by who asks.
    """
    near = s.clear if state.felt_face else s.near
    way = np.array([*state.mouth.place, state.mouth.height + near]) - reading.tip
    if state.felt_face and way[2] > 0.5 * s.clear:
        pressed = float(reading.compliance[2, 2] * (state.free_force - reading.force)[2])
        return Move("above", np.array([0.0, 0.0, way[2] + max(pressed, 0.0)]), state)
    return Move("above", way, state)


def _lower(state: Insertion, reading: TipReading, pushed: np.ndarray, s: InsertionSettings) -> Move:
    """Down in slow steps, towards the hole's place; below a felt face its walls know better where that is."""
    down = np.array([0.0, 0.0, -s.slow_step])
    if state.felt_face and float(reading.tip[2]) < state.mouth.height - s.dipped:
        return Move("lowering", down + _relief(reading, pushed, s), state)
    way = _limited(state.mouth.place - reading.tip[:2], s.side_step)
    return Move("lowering", down + [*way, 0.0], state)


def _search(state: Insertion, reading: TipReading, pushed: np.ndarray, s: InsertionSettings) -> Move:
    here, grid = reading.tip[:2], state.grid
    sinking = state.pressed and float(reading.tip[2]) < state.height - s.sinks
    if state.pressed and not sinking:
        grid = grid.stopped_at(here, s.forgiveness)
    state = replace(state, grid=grid)
    way = grid.next_place(here, s.forgiveness, s.way_cost) - here
    if sinking or not state.pressed:
        more = min(s.press, s.most_press - float(pushed[2]))
        push = reading.compliance @ np.array([0.0, 0.0, -more])
        if sinking:
            push = push + _relief(reading, pushed, s)
        return Move("search", push, replace(state, pressed=True))
    push = reading.compliance @ np.array([0.0, 0.0, float(pushed[2]) - s.slide])
    return Move("search", np.array([*_limited(way, s.side_step), 0.0]) + push, state)


def _follow(state: Insertion, reading: TipReading, pushed: np.ndarray, s: InsertionSettings) -> Move:
    """Down along the hole's axis, in steps; a peg that leans against the walls is turned first."""
    left = float(reading.tip[2]) - (state.touched - s.depth)
    if state.phase == "inserted":  # who asks again reads another height: a little deeper, if it goes easily
        easy = float(pushed[2]) < s.stuck and left > -s.spare_depth
        down = -s.slow_step * np.array([*state.mouth.lean, 1.0])
        return Move(BOTTOM, down if easy else np.zeros(3), state)
    up, here = float(pushed[2]), state.turning
    lean = np.array([*state.mouth.lean, 1.0])
    inside = _surely_inside(state, float(reading.tip[2]), s)
    rubs = beyond_one_wall(pushed, s.turning.friction)  # one wall leads the peg, two hold it
    if here is None and not (inside and leans(rubs, left, s.turning)):
        if up < s.smooth:  # what is read then is the joints' own
            state = _freer(state, reading)
        # As deep again as it is at most: what was taken for the hole and is not stops a short step gently.
        deep = max(s.slow_step, 1.5 * (state.touched - float(reading.tip[2])))
        longest = s.deep_step if rubs < s.smooth else s.tight_step
        down = -min(longest, deep, left + 0.0005) * lean
        return Move("inside", down + _relief(reading, pushed, s), state)
    if here is None:
        turning, down = begun(reading, rubs, state.mouth.lean, s.turning), -s.turning.back
    else:
        sank = (state.height - float(reading.tip[2])) / state.down if state.down > 0.0 else 1.0
        turning, down = turned_on(here, pushed, sank, s.turning)
    eased = up if turning.backed_off else 0.0
    axis = turning_axis(reading)
    # To press down pushes sideways, too, as springs are coupled.
    more = missing_force(turning, float(pushed[:2] @ axis), s.turning)
    change = np.array([*(more * axis), -eased])  # of the push on the peg [N]
    way = -reading.compliance @ change - min(down, left + 0.0005) * lean
    return Move("inside", way, replace(state, turning=turning))


def _surely_inside(state: Insertion, height: float, s: InsertionSettings) -> bool:
    """Whether a tip at a height [m] is so far below the mouth that what stops it are the hole's walls."""
    return height <= state.touched - (s.deep_step if state.felt_face else s.doubtful)


def _force_on_peg(phase: Phase, pushed: np.ndarray, s: InsertionSettings) -> float:
    """Sum of the forces [N] of face or walls on the peg; walls on both sides are felt by friction."""
    if phase in FREE_MOVES:
        return 0.0
    if phase == "search":
        return float(np.linalg.norm(pushed))
    sideways = float(np.linalg.norm(pushed[:2]))
    return sideways + s.walls * max(beyond_one_wall(pushed, s.turning.friction), 0.0)


def _relief(reading: TipReading, pushed: np.ndarray, s: InsertionSettings) -> np.ndarray:
    """Displacement (3,) [m], level, that takes away the part of a sideways push (3,) [N] beyond `side_touch`.

    Torques of joints that rub may read a push that is not there: it must not lead down.
    """
    side = np.array([pushed[0], pushed[1], 0.0])
    size = max(float(np.linalg.norm(side)), 1e-9)
    way = reading.compliance[:2] @ (side * max(0.0, 1.0 - s.side_touch / size))
    return np.array([*_limited(way, s.most_relief), 0.0])


def _limited(way: np.ndarray, longest: float) -> np.ndarray:
    return way * min(1.0, longest / max(float(np.linalg.norm(way)), 1e-12))
