"""Touching down, searching and following, on springs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.control.tip_sense import TipReading
from samrl_core.policy.contact.hole_grid import APART, FREEDOM, REACH, Forgiveness, HoleGrid
from samrl_core.policy.contact.insertion import (
    BOTTOM,
    Insertion,
    InsertionSettings,
    Mouth,
    Move,
    begin,
    looked_again,
    next_move,
)
from tests.policy.contact.spring_block import FREE_FORCE, STIFFNESS, SpringBlock

S = InsertionSettings()
FREE = TipReading(np.zeros(3), FREE_FORCE, np.eye(3) / STIFFNESS)
FACE = 0.0404  # 0.4 mm above where it is believed [m]
HOLE = np.array([0.51, -0.02])


def mouth_at(place: np.ndarray, deviation: float = 0.0008) -> Mouth:
    return Mouth(place, deviation**2 * np.eye(2), 0.040, np.zeros(2))


def insert(error: tuple[float, float], most: int = 60, doubt: float = 1.0) -> tuple[SpringBlock, list[Move]]:
    """From 5 mm above a hole believed `error` beside where it is, each step at most 5 mm."""
    mouth = replace(mouth_at(HOLE + error, 0.0008 * doubt), reach=REACH * doubt)
    block = SpringBlock(np.array([*(mouth.place + [0.004, 0.002]), 0.045]), HOLE, FACE)
    state: Insertion | None = None
    moves: list[Move] = []
    while len(moves) < most:
        reading = block.reading
        state = begin(mouth, reading) if state is None else looked_again(state, mouth, reading)
        moves.append(next_move(state, reading, S))
        state = moves[-1].state
        if state.phase == "inserted":
            break
        way = moves[-1].displacement
        block.move(way * min(1.0, 0.005 / max(float(np.linalg.norm(way)), 1e-9)))
    return block, moves


def phases(moves: list[Move]) -> list[str]:
    return list(dict.fromkeys(move.name for move in moves))


def test_a_well_known_hole_is_entered_without_a_search() -> None:
    block, moves = insert((0.0004, 0.0))
    assert phases(moves) == ["above", "lowering", "inside", BOTTOM]
    depth = 0.040 - float(block.reading.tip[2])  # from where the mouth is believed, for nothing was felt
    assert S.depth < depth < S.depth + 0.001
    assert len(moves) < 20 and block.largest < 4.0


@pytest.mark.parametrize("error", [(0.0016, 0.0), (-0.0012, 0.0014), (0.0, -0.0022)])
def test_a_hole_beside_its_place_is_found_gently(error: tuple[float, float]) -> None:
    block, moves = insert(error)
    assert phases(moves) == ["above", "lowering", "search", "inside", BOTTOM]
    assert moves[-1].state.touched == pytest.approx(FACE, abs=1e-4)
    assert len(moves) < 40 and block.largest < S.most_press + S.press


def test_slow_steps_touch_the_face_first() -> None:
    """No step faster than `slow_step` comes from above to the face or below."""
    for error in ((0.0, 0.0), (0.002, 0.0)):
        _, moves = insert(error)
        for move in moves:
            if move.name == "lowering":
                assert move.displacement[2] == pytest.approx(-S.slow_step)


def test_nothing_but_a_face_is_searched_until_the_actions_end() -> None:
    block, moves = insert((0.006, 0.0))
    assert len(moves) == 60 and moves[-1].state.phase == "search"
    places = {tuple(np.round(1e4 * (m.state.grid.mean - HOLE)).tolist()) for m in moves}
    assert len(places) > 5, "each stop must change the belief"
    assert block.largest < S.most_press + S.press


def test_who_doubts_finds_sooner_what_lies_further_off() -> None:
    """5.7 mm beside where it is believed: beyond the reach of one who takes the cell to be a usual one."""
    _, sure = insert((0.004, -0.004))
    _, doubting = insert((0.004, -0.004), doubt=4.0)
    assert (sure[-1].state.phase, doubting[-1].state.phase) == ("search", "inserted")
    assert len(doubting[0].state.grid.places) < 2000  # a wide grid is a coarse one


def test_in_contact_images_and_free_forces_count_no_more() -> None:
    _, moves = insert((0.0016, 0.0))
    searching = next(m.state for m in moves if m.state.phase == "search")
    assert looked_again(searching, mouth_at(HOLE + 0.1), FREE) is searching
    lowering = next(m.state for m in moves if m.state.phase == "lowering")
    again = looked_again(lowering, mouth_at(HOLE), replace(FREE, force=FREE_FORCE + 5.0))
    assert again.free_force is lowering.free_force and np.array_equal(again.mouth.place, HOLE)


def test_a_block_taken_for_the_hole_is_searched_again() -> None:
    """Believed 5 mm too high, the face is met where the peg should be inside; then it is not the hole."""
    mouth = Mouth(HOLE + [0.002, 0.0], 1e-6 * np.eye(2), FACE + 0.005, np.zeros(2))
    block = SpringBlock(np.array([*mouth.place, FACE + 0.008]), HOLE, FACE)
    state, seen = begin(mouth, block.reading), []
    for _ in range(40):
        move = next_move(state, block.reading, S)
        state = move.state
        seen.append(move.name)
        if state.phase == "inserted":
            break
        block.move(move.displacement)
    assert "search" in seen[seen.index("inside") :] and state.phase == "inserted"
    assert FACE - float(block.reading.tip[2]) > S.depth - 0.0005


def test_asked_once_more_it_goes_deeper_only_while_that_is_easy() -> None:
    _, moves = insert((0.0, 0.0))
    done, tip = moves[-1].state, np.array([*HOLE, FACE - S.depth - 0.0002])
    block = SpringBlock(tip, HOLE, FACE)
    assert next_move(done, block.reading, S).displacement[2] == pytest.approx(-S.slow_step)
    block.reading.force[2] -= 2 * S.stuck
    assert not next_move(done, block.reading, S).displacement.any()


def test_stops_move_the_belief_away_and_the_next_place_covers_most() -> None:
    f = Forgiveness()
    grid = HoleGrid.of(HOLE, 0.0008**2 * np.eye(2))
    np.testing.assert_allclose(grid.mean, HOLE, atol=1e-9)
    assert (grid.deviation > 0.0008).all(), "tails are heavier than a Gaussian's"
    inner = grid.weights[np.linalg.norm(grid.places - HOLE, axis=1) < 0.0008].sum()
    within_one = 1.0 - (1.0 + 1.0 / FREEDOM) ** (-0.5 * FREEDOM)  # of Student's t in two dimensions
    assert inner == pytest.approx(within_one, abs=0.06)
    np.testing.assert_allclose(grid.next_place(HOLE, f, 60.0), HOLE, atol=3e-4)
    stopped = grid.stopped_at(HOLE, f)
    assert stopped.chance(HOLE, f) < 0.7 * grid.chance(HOLE, f)
    there = stopped.next_place(HOLE, f, 60.0)
    assert 0.0005 < np.linalg.norm(there - HOLE) < 0.003
    others = stopped.places[np.linalg.norm(stopped.places - HOLE, axis=1) > APART]
    best = max(stopped.chance(p, f) for p in others[::7])
    assert stopped.chance(stopped.next_place(HOLE, f, 0.0), f) >= best > 0.1


@pytest.mark.parametrize("higher", [0.0045, 0.0, -0.0045])
def test_a_face_of_unknown_height_is_felt_beside_the_hole_first(higher: float) -> None:
    """Then the hole is entered from that height, and its depth counts from there."""
    face = 0.040 + higher
    mouth = replace(mouth_at(HOLE), height_deviation=0.002, beside=HOLE + [0.012, 0.0])
    block = SpringBlock(np.array([*HOLE, 0.060]), HOLE, face)
    state, moves = begin(mouth, block.reading), []
    for _ in range(60):
        felt = state.mouth if state.felt_face else mouth  # what the memory of a touch makes of it
        state = looked_again(state, felt, block.reading)
        moves.append(next_move(state, block.reading, S))
        state = moves[-1].state
        if state.phase == "inserted":
            break
        way = moves[-1].displacement
        step = way * min(1.0, 0.005 / max(float(np.linalg.norm(way)), 1e-9))
        state = replace(state, down=-float(step[2]))
        block.move(step)
    assert phases(moves) == ["feel", "above", "lowering", "inside", BOTTOM]
    assert state.mouth.height == pytest.approx(face, abs=2e-4)
    assert face - float(block.reading.tip[2]) == pytest.approx(S.depth, abs=1e-3)
    assert len(moves) < 32 and block.largest < 8.0


def test_what_rubs_while_it_sinks_is_no_touch() -> None:
    """3 N against the motion, read from the first step down on, stop nothing."""
    mouth = replace(mouth_at(HOLE), height_deviation=0.002, beside=HOLE + [0.012, 0.0])
    tip = np.array([*mouth.beside, 0.0424])
    state = begin(mouth, FREE)
    for _ in range(3):
        reading = TipReading(tip, FREE_FORCE - [0.0, 0.0, 3.0], np.eye(3) / 1500.0)
        move = next_move(state, reading, S)
        state, tip = move.state, tip + move.displacement
        assert move.name == "feel" and move.displacement[2] == pytest.approx(-S.slowest_step)
    stuck = TipReading(tip - move.displacement, FREE_FORCE - [0.0, 0.0, 6.0], np.eye(3) / 1500.0)
    touched = next_move(state, stuck, S).state
    assert touched.felt_face and touched.touched == pytest.approx(float(stuck.tip[2]))


def test_a_sideways_push_is_relieved_level() -> None:
    """A compliance that couples sideways and down does not lead a peg down."""
    mouth = mouth_at(HOLE)
    inside = replace(begin(mouth, FREE), phase="inside", touched=0.040, felt_face=True)
    coupled = np.array([[1.7, 0.0, -0.9], [0.0, 1.7, 0.0], [-0.9, 0.0, 0.7]]) * 1e-3
    reading = TipReading(np.array([*HOLE, 0.030]), FREE_FORCE + [8.0, 0.0, 0.0], coupled)
    way = next_move(inside, reading, S).displacement
    assert way[2] == pytest.approx(-S.deep_step) and way[0] == pytest.approx(-S.most_relief)


def test_who_is_stopped_twice_stands_on_something_whatever_is_read() -> None:
    """Friction in the joints may hide a force, and holds back one step in free air, not two."""
    mouth = mouth_at(HOLE)
    state = replace(begin(mouth, FREE), phase="lowering", height=0.0405, down=S.slow_step)
    reading = TipReading(np.array([*HOLE, 0.0404]), FREE_FORCE, np.eye(3) / 1500.0)
    first = next_move(state, reading, S)
    second = next_move(first.state, reading, S)
    assert (first.name, second.name) == ("lowering", "search")
