"""Columns that name position, velocity and torque by a letter, as MIT's drives do: `hip_p`, `hip_t_ff`.

A letter may be a pressure, a voltage or a time: it is read where p and v stand side by side, and asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from samrl_ros.log_import.draft.column_names import meaning
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.joints.named_sources import NamedBlock, name_of
from samrl_ros.log_import.draft.letter_names import LETTERS, letter_of, with_letter


def read_letters(found: Sequence[NamedBlock], draft: Draft) -> list[NamedBlock]:
    """Blocks with the meaning of their letters where nothing is called a position; others as they are.

    Args:
        found: blocks of the log.
        draft: to which a question is added.
    """
    if any(each.meaning.quantity == "position" and not each.meaning.commanded for each in found):
        return list(found)
    stems = {(id(each.part), each.block.stem): each for each in found}
    pairs = [
        (each, stems[key])
        for each in found
        if not each.meaning.quantity and letter_of(each.block.stem, alone=True) == "p"
        and (key := (id(each.part), with_letter(each.block.stem, "v"))) in stems
        and set(stems[key].block.labels) == set(each.block.labels)
    ]  # fmt: skip
    if not pairs:
        return list(found)
    parts = {id(position.part) for position, _ in pairs}
    position, velocity = pairs[0]
    draft.note(
        "channels.states.position",
        f"{name_of(position)} stands beside {name_of(velocity)}",
        f"do p, v and t of {name_of(position)} and its like mean position, velocity and torque?",
    )
    return [
        replace(each, meaning=meaning(with_letter(stem, LETTERS[letter])))
        if id(each.part) in parts and not each.meaning.quantity
        and (letter := letter_of(stem := each.block.stem))
        else each
        for each in found
    ]  # fmt: skip
