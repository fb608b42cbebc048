"""Columns of a machine that slides and turns: `x` and `theta` of a cart and its pole, in one block.

No part of their names is alike, and neither is their unit: which is which follows from the kinds of joints.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.diagnosis.recordings.units import joint_kinds
from samrl_ros.log_import.draft import evidence
from samrl_ros.log_import.draft.column_names import words_in
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.joints.named_by_word import (
    columns_of,
    in_the_same_rows,
    is_angle,
    is_measured,
    put_together,
)
from samrl_ros.log_import.draft.joints.named_sources import NamedBlock
from samrl_ros.log_import.draft.joints.sliding_joints import named_length

_SLIDES = frozenset("x cart slide slider rail carriage track trolley".split())
_ANGLES = frozenset("rad deg".split())


def group_by_kind(
    found: list[NamedBlock], joints: Sequence[str], urdf: str | None, draft: Draft
) -> list[NamedBlock]:
    """Positions in lengths and angles, and their speeds, as one block each.

    Only where the description has joints of both kinds, no block holds all positions, and the log has one
    measured length for each sliding joint and one angle for each that turns, in the same rows. Several of a
    kind are asked for.

    Args:
        found: blocks of the log.
        joints: of the robot's description.
        urdf: its text, if there is one.
        draft: to which reason and question are added.
    """
    kinds = {} if urdf is None else joint_kinds(urdf)
    slides = [joint for joint in joints if kinds[joint].prismatic]
    turns = [joint for joint in joints if not kinds[joint].prismatic]
    placed = [each for each in found if each.meaning.quantity == "position" and is_measured(each)]
    whole = any(len(each.block.labels) >= len(joints) for each in placed)
    whole = whole or any(each.part.kind for each in found)
    if not slides or not turns or whole:
        return found
    singles = [one for each in found for one in columns_of(each) if is_measured(one)]
    lengths = [one for one in singles if _is_length(one)]
    angles = [one for one in singles if is_angle(one) and not _is_length(one)]
    places = [*lengths, *angles]
    if len(lengths) != len(slides) or len(angles) != len(turns) or not in_the_same_rows(places):
        return found
    of = dict(zip([*slides, *turns], places, strict=True))
    positions = [of[joint] for joint in joints]
    rates = _rates_of(positions, singles)
    said = ", ".join(f"{of[joint].block.stem} is {joint}" for joint in joints)
    several = len(slides) > 1 or len(turns) > 1
    question = f"is each whose it seems to be, {said}?" if several else ""
    draft.note("joints", f"of what slides and what turns: {said}", question, "order")
    return put_together(found, joints, positions, rates, angles[0].meaning)


def _is_length(one: NamedBlock) -> bool:
    """Whether a column may be how far something slid: by its unit, or by what slides."""
    told, words = one.meaning, words_in(one.block.stem)
    if told.unit in _ANGLES or "dot" in words or not np.ptp(one.block.values) > 0.0:
        return False
    named = bool(named_length(one.block.columns[0])) or not _SLIDES.isdisjoint(words)
    return named and told.quantity in ("", "position")


def _rates_of(positions: Sequence[NamedBlock], singles: Sequence[NamedBlock]) -> list[NamedBlock]:
    """The column that is each position's rate, by their numbers; none where one has none.

    Time is counted in rows: of a velocity in any unit the correlation alone says that it is the rate.
    """
    places = {one.block.columns[0] for one in positions}
    others = [one for one in singles if one.block.columns[0] not in places and one.part is positions[0].part]
    out = []
    for one in positions:
        time = np.arange(len(one.block.values), dtype=float)
        same = [o for o in others if np.array_equal(o.block.rows, one.block.rows)]
        fits = [evidence.fit_rate(time, one.block.values, other.block.values) for other in same]
        best = max(zip(fits, same, strict=True), key=lambda pair: pair[0].correlation, default=None)
        if best is None or best[0].correlation < evidence.AGREES:
            return []
        out.append(best[1])
    return out if len({one.block.columns for one in out}) == len(out) else []
