"""A peg that leans is backed off, turned by a force at its end, and lowered again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.control.tip_sense import TipReading
from samrl_core.policy.contact.insertion import BOTTOM, Insertion, InsertionSettings, Mouth, begin, next_move
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

S, T = InsertionSettings(), TurningSettings()
FREE = np.array([1.5, -0.4, -1.2])  # read when nothing is touched [N]
HOLE, FACE = np.array([0.51, -0.02]), 0.040
SOFT = np.array([0.0012, 0.0047, 0.0007])  # compliance of a Panda's tip over the bench [m/N]
TURN_X = 0.0032  # of that tip about y by a force along x [rad/N]


def soft(tip: np.ndarray, pushed: np.ndarray) -> TipReading:
    turning = np.zeros((3, 3))
    turning[0, 1], turning[1, 0] = 0.0020, -TURN_X
    return TipReading(tip, FREE - pushed, np.diag(SOFT), turning)


class LeaningPeg:
    """Walls push a peg apart by 2.4 kN, at 20 mm, for each radian by which it leans more than its depth
    allows, with friction of 0.25; a force at its end turns it. It leans by `lean` [rad] about y.
    """

    def __init__(self, lean: float, depth: float = 0.008) -> None:
        self.lean, self.tip = lean, np.array([*HOLE, FACE - depth])
        self.commanded, self.largest = self.tip.copy(), 0.0
        self.pushed = np.zeros(3)

    def move(self, displacement: np.ndarray) -> None:
        self.commanded = self.commanded + displacement
        side = (self.tip[0] - self.commanded[0]) / SOFT[0]  # of one wall on its end
        for _ in range(400):  # sinks, or is lifted, until friction holds it
            press = (self.tip[2] - self.commanded[2]) / SOFT[2]
            hold = 0.25 * (abs(side) + self._apart(side))
            if abs(press) <= hold:
                break
            self.tip[2] -= np.copysign(2e-5, press)
        self.pushed = np.array([side, 0.0, press])
        self.largest = max(self.largest, abs(side) + self._apart(side))

    def _apart(self, side: float) -> float:
        depth = max(FACE - float(self.tip[2]), 1e-3)
        return 1.2e5 * depth * max(abs(self.lean + TURN_X * side) - 0.0004 / depth, 0.0)

    @property
    def reading(self) -> TipReading:
        return soft(self.tip.copy(), self.pushed)


def insert(peg: LeaningPeg, lean_seen: float) -> tuple[Insertion, int]:
    mouth = Mouth(HOLE, 1e-8 * np.eye(2), FACE, np.array([lean_seen, 0.0]))
    state = replace(begin(mouth, soft(peg.tip, np.zeros(3))), phase="inside", touched=FACE, felt_face=True)
    for count in range(40):
        move = next_move(state, peg.reading, S)
        state = move.state
        if move.name == BOTTOM:
            return state, count
        peg.move(move.displacement)
    return state, 40


@pytest.mark.parametrize("lean", [0.045, -0.045])
@pytest.mark.parametrize("lean_seen", [0.02, -0.02])
def test_a_peg_that_leans_goes_in_gently_whichever_way_it_is_tried_first(
    lean: float, lean_seen: float
) -> None:
    peg = LeaningPeg(lean)
    state, count = insert(peg, lean_seen)
    assert state.phase == "inserted" and count < 30
    assert peg.largest < 42.0
    assert state.turning is not None and np.sign(state.turning.force) == -np.sign(lean)


def test_pressed_on_it_would_be_pressed_too_hard() -> None:
    """The same peg, never turned: what the forces above are to be compared with."""
    peg = LeaningPeg(0.045)
    for _ in range(40):
        peg.move(np.array([0.0, 0.0, -0.0015]))
    assert peg.largest > 60.0


def test_a_straight_peg_is_not_turned() -> None:
    peg = LeaningPeg(0.0)
    state, count = insert(peg, 0.02)
    assert state.phase == "inserted" and state.turning is None and count < 8


def test_it_is_turned_where_the_arm_gives_way_least_for_it() -> None:
    reading = soft(np.zeros(3), np.zeros(3))
    assert np.array_equal(turning_axis(reading), [1.0, 0.0])
    turned = [float((reading.turning @ [begun(reading, 2.0, lean, T).force, 0.0, 0.0])[1]) for lean in LEANS]
    assert turned[0] > 0.0 > turned[1], "towards the hole's axis as images show it"


LEANS = (np.array([0.01, 0.0]), np.array([-0.01, 0.0]))


def test_the_wrong_way_is_taken_back_through_none() -> None:
    turning = replace(Turning(6.0, 6.0, 3.0, 1.2), backed_off=False)
    back, down = turned_on(turning, np.array([6.0, 0.0, 6.0]), 0.9 * T.sinks, T)
    assert (back.force, back.wanted, back.backed_off) == (0.0, -6.0, True) and down < 0.0
    there, _ = turned_on(back, np.zeros(3), 1.0, T)
    assert there.force == -6.0 and there.backed_off
    pressed, down = turned_on(there, np.zeros(3), 1.0, T)
    assert not pressed.backed_off and down > 0.0


def test_what_one_wall_rubs_is_no_lean() -> None:
    assert beyond_one_wall(np.array([6.0, 8.0, 3.0]), 0.3) == pytest.approx(0.0)
    turning = replace(Turning(10.0, 10.0, 3.0, 1.2), backed_off=False, new=False)
    on, down = turned_on(turning, np.array([10.0, 0.0, 2.9]), 1.0, T)
    assert on.force == 10.0 and down == T.long_step
    more, down = turned_on(turning, np.array([10.0, 0.0, 4.5]), 1.0, T)
    assert more.force == 13.0 and down < 0.0


@pytest.mark.parametrize("side", [0.0, 4.0])
def test_one_wall_that_rubs_begins_no_turn_and_two_do(side: float) -> None:
    """1.2 N along the axis: without a sideways force two walls hold the peg, beside 4 N one leads it in."""
    tip = np.array([*HOLE, FACE - 0.008])
    mouth = Mouth(HOLE, 1e-8 * np.eye(2), FACE, np.zeros(2))
    state = replace(begin(mouth, soft(tip, np.zeros(3))), phase="inside", touched=FACE, felt_face=True)
    move = next_move(state, soft(tip, np.array([side, 0.0, 1.2])), S)
    if side:
        assert move.state.turning is None and move.displacement[2] == pytest.approx(-S.deep_step)
    else:
        assert move.state.turning is not None and move.displacement[2] > 0.0
        assert move.state.turning.before == pytest.approx(1.2)


def test_a_force_that_is_there_is_left() -> None:
    turning = Turning(6.0, 6.0, 3.0, 1.2)
    assert missing_force(turning, 2.0, T) == pytest.approx(4.0)
    assert missing_force(turning, 6.0 + 0.5 * T.spare, T) == 0.0
    assert missing_force(turning, 7.0 + T.spare, T) == pytest.approx(-1.0)
    assert missing_force(replace(turning, force=0.0), -5.0, T) == pytest.approx(5.0)


def test_near_the_bottom_it_is_pressed_on() -> None:
    assert leans(1.1, 0.010, T) and not leans(1.1, 0.005, T)
    assert leans(2.6, 0.005, T) and not leans(2.6, 0.002, T) and leans(5.1, -0.001, T)
