"""What is said of efforts and currents whose meaning a log leaves open."""

from __future__ import annotations

import numpy as np

from samrl_ros.log_import.draft import evidence
from samrl_ros.log_import.draft.column_names import QUANTITIES, words_in
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.joints.arm_messages import CURRENTS_OF_UR
from samrl_ros.log_import.draft.joints.motor_input import is_supplys
from samrl_ros.log_import.draft.joints.named_sources import NamedBlock, name_of, shares_rows

_TORQUES = frozenset(QUANTITIES["effort"].split())
_DRIVE = ("effort", "current", "voltage")
_LIES_ON = 0.2  # of a joint's motion, within which a set point stays from its position


def say_how_used(current: NamedBlock) -> str:
    """What to do with a current, a voltage or a pressure that is not used.

    A torque worked out of a current is a drive's.
    """
    if current.meaning.quantity == "pressure":
        return (
            f"{name_of(current)}: a cylinder's force is the difference of its chambers' pressures times their"
            " areas, 1e5 * (pA * areaA - pB * areaB) of bar and m2; use it as commanded_effort"
        )
    if _TORQUES & set(words_in(current.block.stem)):
        return (
            f"{name_of(current)}: if this is a torque worked out of the current, in N m at the joints, it is"
            " the drive's: use it as commanded_effort as it is"
        )
    if current.meaning.quantity == "voltage":
        return (
            f"{name_of(current)}: a motor's volts or duty tell its effort by torque constant, resistance and"
            " gear ratio (unit V of a controller that states them); a supply's tell none"
        )
    return f"{name_of(current)}: multiply by torque constant and gear ratio, then use it as effort"


def without_held(measured: list[NamedBlock], position: NamedBlock, draft: Draft) -> list[NamedBlock]:
    """Without torques of a slower topic that stand in each row of a faster one: late, and in steps."""
    held = {
        name_of(each): rows
        for each in measured
        if shares_rows(each, position)
        and (rows := evidence.rows_held(each.block.values, position.block.values)) > 1
    }
    draft.unused += [
        f"{name}: each value is held for {rows} rows: import it from the file or topic that it comes from"
        for name, rows in held.items()
    ]
    return [each for each in measured if name_of(each) not in held]


def without_zeros(found: list[NamedBlock], draft: Draft) -> list[NamedBlock]:
    """Without torques that are zero throughout where something else may drive the joints.

    Controllers log what they could have asked for beside what they did, as the feed-forward of a trajectory.
    """
    able = [each for each in found if each.meaning.quantity in _DRIVE and not each.meaning.computed]
    zero = [each for each in able if each.meaning.quantity == "effort" and not each.block.values.any()]
    if len(zero) == len([each for each in able if not is_supplys(each)]):
        return found
    draft.unused += [f"{name_of(each)}: zero throughout: it drives nothing" for each in zero]
    return [each for each in found if each not in zero]


def asked_of_effort(effort: NamedBlock, position: NamedBlock, may_be_currents: bool) -> str:
    """Where a measured effort belongs, when nobody said so."""
    question = (
        f"what is {name_of(effort)}? The drive's torque times gear ratio (as drafted; --effort drive), the"
        " torque of a sensor behind the gears (--effort link), or a motor's current (multiply it by its"
        " torque constant and gear ratio in the mapping; --effort none leaves it out)"
    )
    if "%" in effort.block.stem:
        question += "; in per cent of what? Multiply by a hundredth of each drive's rated torque or force"
    if may_be_currents:
        question += f"; {CURRENTS_OF_UR}"
    if _lies_on(effort, position):
        question += "; or a set point, as it lies on the position: then it is the command's position"
    return question


def _lies_on(effort: NamedBlock, position: NamedBlock) -> bool:
    """Whether numbers called efforts are those of the positions, up to a fifth of the motion."""
    if effort.part is not position.part or effort.block.labels != position.block.labels:
        return False
    rows = position.block.rows & effort.block.rows
    q = position.block.values[rows[position.block.rows]]
    apart = np.abs(effort.block.values[rows[effort.block.rows]] - q).max(axis=0)
    moving = np.ptp(q, axis=0) > 0.0
    return bool((apart < _LIES_ON * np.ptp(q, axis=0))[moving].any())
