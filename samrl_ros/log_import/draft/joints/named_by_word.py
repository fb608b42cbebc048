"""Columns that name their joints by a word: `theta_arm` and `alpha_pend` of `arm` and `pendulum`.

Each has a letter of its own, so that no part of their names is alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from samrl_ros.log_import.draft.column_names import NameMeaning, meaning, words_in
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.joints.named_sources import NamedBlock, column_alone

_LETTERS = frozenset("alpha beta gamma phi psi theta q".split())  # of angles
_RATES = frozenset(("dot", "ddot"))
_UNITS = frozenset("rad deg mm".split())
_NO_NAMES = frozenset("joint joints link".split())
_SHORTENED = 4  # letters from which the beginning of a joint's name stands for it: pend


def group_by_word(found: list[NamedBlock], joints: Sequence[str], draft: Draft) -> list[NamedBlock]:
    """Positions, and their speeds, of which each names another joint by a word, as one block each.

    Only where every joint of the description has one such position, in the same rows and unit, and no block
    holds them all already. Which is which is asked for.

    Args:
        found: blocks of the log.
        joints: of the robot's description.
        draft: to which reason and question are added.
    """
    known = any(set(joints) <= set(each.block.labels) for each in found)
    if len(joints) < 2 or known or any(each.part.kind for each in found):
        return found
    singles = [one for each in found for one in columns_of(each)]
    places = [one for one in singles if is_angle(one)]
    positions = _one_each([[one for one in places if _names(one, joints) == [joint]] for joint in joints])
    if not positions:
        return found
    first = [words_in(one.block.stem)[0] for one in positions]
    speeds = [one for one in singles if _is_speed(one)]
    rates = _one_each(
        [
            [one for one in speeds if _names(one, joints) == [joint] or words_in(one.block.stem)[0] == letter]
            for joint, letter in zip(joints, first, strict=True)
        ]
    )
    said = ", ".join(f"{one.block.stem} is {joint}" for one, joint in zip(positions, joints, strict=True))
    draft.note("joints", "columns name them by a word", f"is each whose it seems to be, {said}?", "order")
    return put_together(found, joints, positions, rates, positions[0].meaning)


def put_together(
    found: list[NamedBlock],
    joints: Sequence[str],
    positions: Sequence[NamedBlock],
    rates: Sequence[NamedBlock],
    told: NameMeaning,
) -> list[NamedBlock]:
    """The blocks, in front one of positions, which mean `told`, and one of speeds if there are any."""
    taken = {one.block.columns[0] for one in (*positions, *rates)}
    kept: list[NamedBlock] = []
    for each in found:
        whole = taken.isdisjoint(each.block.columns)
        kept += [each] if whole else [o for o in columns_of(each) if o.block.columns[0] not in taken]
    speeds = [_joined(rates, joints, "velocity", rates[0].meaning)] if rates else []
    return [_joined(positions, joints, "position", told), *speeds, *kept]


def columns_of(each: NamedBlock) -> list[NamedBlock]:
    """A block's columns apart; none of an array."""
    columns = each.block.columns
    if len(columns) != len(each.block.labels):
        return []
    return [replace(column_alone(each, k), meaning=meaning(name)) for k, name in enumerate(columns)]


def is_measured(one: NamedBlock) -> bool:
    """Whether a column is neither wanted nor worked out."""
    return not one.meaning.commanded and not one.meaning.computed


def is_angle(one: NamedBlock) -> bool:
    """Whether a column may be a joint's position: by its quantity, unit or letter."""
    told = one.meaning
    named = bool(told.unit in _UNITS or _LETTERS & set(words_in(one.block.stem)))
    may_be = told.quantity == "position" or (not told.quantity and named)
    return (
        may_be
        and _RATES.isdisjoint(words_in(one.block.stem))
        and is_measured(one)
        and bool(np.ptp(one.block.values) > 0.0)
    )


def _is_speed(one: NamedBlock) -> bool:
    """Whether a column may be a joint's speed: `alpha_dot`."""
    told, words = one.meaning, set(words_in(one.block.stem))
    dotted = not told.quantity and "dot" in words and bool(_LETTERS & words)
    return (told.quantity == "velocity" or dotted) and is_measured(one)


def _names(one: NamedBlock, joints: Sequence[str]) -> list[str]:
    """Joints that a word of a column's name is of."""
    words = words_in(one.block.stem)
    return [joint for joint in joints if any(_stands_for(word, joint) for word in words)]


def _stands_for(word: str, joint: str) -> bool:
    own = [each for each in words_in(joint) if each not in _NO_NAMES and not each.isdecimal()]
    return any(word == each or (len(word) >= _SHORTENED and each.startswith(word)) for each in own)


def _one_each(candidates: Sequence[Sequence[NamedBlock]]) -> list[NamedBlock]:
    """The one candidate of each joint; none where one has none or several, or rows or units differ."""
    if any(len(each) != 1 for each in candidates):
        return []
    found = [each[0] for each in candidates]
    alike = in_the_same_rows(found) and len({one.meaning.unit for one in found}) == 1
    return found if alike and len({one.block.columns for one in found}) == len(found) else []


def in_the_same_rows(columns: Sequence[NamedBlock]) -> bool:
    """Whether columns are of one table, with their numbers in the same rows."""
    head = columns[0]
    return all(one.part is head.part and np.array_equal(one.block.rows, head.block.rows) for one in columns)


def _joined(
    columns: Sequence[NamedBlock], joints: Sequence[str], quantity: str, told: NameMeaning
) -> NamedBlock:
    """Columns as one block, labelled as the joints are, that means what one of them does."""
    head = columns[0]
    block = replace(
        head.block,
        stem=", ".join(one.block.stem for one in columns),
        labels=tuple(joints),
        columns=tuple(one.block.columns[0] for one in columns),
        values=np.hstack([one.block.values for one in columns]),
    )
    return replace(head, block=block, meaning=replace(told, quantity=quantity))
