"""Which columns may be of joints at all, and what is said where none are."""

from __future__ import annotations

from collections.abc import Sequence

from samrl_ros.log_import.draft.column_names import words_in
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.joints.named_sources import NamedBlock, name_of

_TOOL = frozenset("tcp eef ee".split())
_SHOWN = 20  # columns that a message names


def without_tool(found: list[NamedBlock], draft: Draft) -> list[NamedBlock]:
    """Without what names say of a tool, such as `actual_TCP_force_0`: as many numbers, but not of joints."""
    kept = [each for each in found if not _TOOL & set(words_in(each.block.stem))]
    if not kept:
        return found
    draft.unused += [f"{name_of(each)}: of the tool" for each in found if each not in kept]
    return kept


def nothing_measured(found: Sequence[NamedBlock]) -> str:
    """Why no position was found, and what to do about it."""
    columns = [f"{c.part.path.name}: {name}" for c in found for name in c.block.columns]
    if not columns:
        return "the log holds no columns of numbers; name the file of the motion"
    if len(columns) == 1:
        return (
            f"{columns[0]} is one column, and nothing to compare it with is beside it: a second clock's"
            " stamps, the true distance, a command; columns need names in a first line, such as device,host"
        )
    shown = ", ".join(columns[:_SHOWN]) + (", ..." if len(columns) > _SHOWN else "")
    if all(name.isdecimal() for c in found for name in c.block.columns):
        return f"{shown} have no names; name the columns in a first line, such as time,q1,q2,tau1,tau2"
    return (
        f"no measured position was found among {shown}; write the mapping by hand, or name the robot's"
        " URDF by --urdf if columns are called as its joints are"
    )
