"""Angles of a log that wrap around, as 0 to 360 degrees or 0 to 4095 counts: their turns are taken out.

What follows such an angle wraps with it, and may begin a turn away; so may the angle, by its joint's limits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from samrl_core.diagnosis.recordings.turns import find_wraps
from samrl_core.diagnosis.recordings.units import joint_kinds
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.joints.named_sources import NamedBlock, name_of

TURNS = {"rad": 2.0 * np.pi, "deg": 360.0, "rev": 1.0}
_EVEN = 1e-3  # by which a step may miss a share of a turn, as written
_OFF_LEVEL = 0.1  # of a step, by which a number may miss its level
_SHIFTS = (-2, -1, 0, 1, 2)  # whole turns that a log may be away
_SLACK = 0.1  # [rad] beyond the limits that zeros and soft stops may account for
_TURN_WORDS = {"rad": "2 * pi", "deg": "360", "rev": "1"}
_HALF_WORDS = {"rad": "pi", "deg": "180", "rev": "0.5"}
_COUNTS = (
    360,
    400,
    512,
    1000,
    1024,
    2000,
    2048,
    4000,
    4096,
    8192,
    10000,
    16384,
    32768,
    36000,
    65536,
    1 << 20,
)


def turn_of(position: NamedBlock, unit: str) -> float:
    """How much of a position is a turn, where it wraps around; 0 where it does not."""
    turns = [TURNS[unit]] if unit in TURNS else []
    if unit.startswith("counts"):
        largest = float(np.ptp(position.block.values))
        turns = [float(next((n for n in _COUNTS if n > largest), 0))]
    wraps = any(len(find_wraps(angles, turn)) for turn in turns if turn for angles in position.block.values.T)
    return turns[0] if wraps else 0.0


def unit_of_steps(values: np.ndarray) -> str:
    """`deg` or `rad` where all numbers are multiples of a turn's share by an encoder's counts; else empty."""
    levels = np.unique(values)
    if not 2 < len(levels) < len(values):
        return ""
    step = float(np.diff(levels).min())
    for unit in ("deg", "rad"):
        counts = TURNS[unit] / max(step, 1e-12)
        near = min(_COUNTS, key=lambda count: abs(count - counts))
        even = np.abs(levels / TURNS[unit] * near - np.round(levels / TURNS[unit] * near))
        if near > _COUNTS[0] and abs(counts / near - 1.0) < _EVEN and even.max() < _OFF_LEVEL:
            return unit
    return ""


def take_turns_out(
    position: NamedBlock, order: Sequence[str], turn: float, quantity: dict[str, Any], draft: Draft
) -> NamedBlock:
    """The position without its jumps; its formulas say so.

    Args:
        position: of the joints.
        order: labels of the joints, as the formulas are.
        turn: of the position's unit.
        quantity: of the mapping, whose formulas are changed.
        draft: to which the reason is added.
    """
    values, jumps = position.block.values.copy(), 0
    for label in order:
        k, number = position.block.labels.index(label), order.index(label)
        if len(found := find_wraps(values[:, k], turn)):
            values[:, k] = np.unwrap(values[:, k], period=turn)
            quantity["formula"][number] = _unwrapped(quantity["formula"][number], turn, quantity["unit"])
            jumps += len(found)
    draft.note(
        "channels.states.position",
        f"it jumps by {turn:.4g} {'counts' if quantity['unit'].startswith('counts') else quantity['unit']}"
        f" {jumps} times and goes on as before: an angle that wraps around, so unwrap",
    )
    return replace(position, block=replace(position.block, values=values))


def move_into_limits(
    position: NamedBlock, order: Sequence[str], urdf: str, quantity: dict[str, Any], draft: Draft
) -> NamedBlock:
    """The position whole turns less where only that lies within the URDF's limits: 350 degrees are -10.

    Args:
        position: of the joints, without jumps.
        order: labels of the joints, as the formulas and the draft's joints are.
        urdf: text.
        quantity: of the mapping, whose formulas are changed.
        draft: to which the reason is added.
    """
    if (turn := TURNS.get(quantity["unit"])) is None:
        return position
    kinds, values, moved = joint_kinds(urdf), position.block.values.copy(), []
    for number, (label, joint) in enumerate(zip(order, draft.joints, strict=True)):
        k, kind = position.block.labels.index(label), kinds.get(joint)
        if kind is None or kind.prismatic or not np.isfinite([kind.lower, kind.upper]).all():
            continue
        low, high = (limit * turn / (2.0 * np.pi) for limit in (kind.lower - _SLACK, kind.upper + _SLACK))
        least, most = float(values[:, k].min()), float(values[:, k].max())
        fits = [n for n in _SHIFTS if low <= least - n * turn and most - n * turn <= high]
        if len(fits) == 1 and fits[0]:
            values[:, k] -= fits[0] * turn
            formula = quantity["formula"][number]
            quantity["formula"][number] = _turns_away(
                formula, fits[0], float(values[0, k]), turn, quantity["unit"]
            )
            moved.append(joint)
    if not moved:
        return position
    draft.note(
        "channels.states.position", f"{', '.join(moved)}: whole turns less lie within the URDF's limits",
        if_other="turns of the unit that is asked",
    )  # fmt: skip
    return replace(position, block=replace(position.block, values=values))


def take_turns_out_beside(
    position: NamedBlock, command: NamedBlock, order: Sequence[str], turn: float, draft: Draft
) -> None:
    """A command of an angle that wraps, likewise; a turn between the two is no error of the controller."""
    quantity = draft.channels["command"]["position"]
    for number, label in enumerate(order):
        if label not in command.block.labels or label not in position.block.labels:
            continue
        measured = position.block.values[:, position.block.labels.index(label)]
        values = command.block.values[:, command.block.labels.index(label)]
        formula = quantity["formula"][number]
        if len(find_wraps(values, turn)):
            values = np.unwrap(values, period=turn)
            formula = _unwrapped(formula, turn, quantity["unit"])
        away = round(float(np.median(values) - np.median(measured)) / turn)
        if away:
            formula = _turns_away(formula, away, float(values[0] - away * turn), turn, quantity["unit"])
        if formula != quantity["formula"][number]:
            quantity["formula"][number] = formula
            draft.note(
                "channels.command.position", f"{name_of(command)} wraps around as the position does: unwrap"
            )


def _turns_away(formula: str, count: int, first: float, turn: float, unit: str) -> str:
    """The formula so many turns less, where its first value is `first`.

    What wraps around begins within half a turn of zero in each recording: one may begin at 359.98 degrees and
    the next at 0.02.
    """
    word, half = _turn_word(turn, unit), _HALF_WORDS.get(unit, f"{0.5 * turn:.0f}")
    begin, end, divisor = "unwrap(", f", {word})", f"({word})" if " " in word else word
    if formula.startswith(begin) and formula.endswith(end) and abs(first) < 0.5 * turn:
        return f"{begin}({formula[len(begin) : -len(end)]} + {half}) % {divisor} - {half}{end}"
    return f"{formula} {'-' if count > 0 else '+'} {abs(count)} * {word}"


def _unwrapped(formula: str, turn: float, unit: str) -> str:
    return f"unwrap({formula}, {_turn_word(turn, unit)})"


def _turn_word(turn: float, unit: str) -> str:
    return _TURN_WORDS.get(unit, f"{turn:.0f}")
