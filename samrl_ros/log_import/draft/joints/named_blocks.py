"""Which columns may be of joints at all, and what is said where none are."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from samrl_ros.log_import.draft.column_names import words_in
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.joints.named_sources import NamedBlock, name_of
from samrl_ros.log_import.tables import is_text_table

_OF_ISAAC, _RELATIVE = re.compile(r"states\.articulation\.[^.]+\.joint_position"), "obs.joint_pos"
_TOOL = frozenset("tcp eef ee".split())
_SHOWN = 20  # columns that a message names
_SAME = 1e-4  # of an angle's largest, by which the same angle in another unit may differ: digits
_UNITS = (1.0, np.pi / 180.0, 180.0 / np.pi)  # of one angle's numbers to those of another


def without_tool(found: list[NamedBlock], draft: Draft) -> list[NamedBlock]:
    """Without what names say of a tool, such as `actual_TCP_force_0`: as many numbers, but not of joints."""
    kept = [each for each in found if not _TOOL & set(words_in(each.block.stem))]
    if not kept:
        return found
    draft.unused += [f"{name_of(each)}: of the tool" for each in found if each not in kept]
    return kept


def without_relative(found: list[NamedBlock], draft: Draft) -> list[NamedBlock]:
    """Without Isaac Lab's observed positions where its states are there: those are relative to a pose."""
    if not any(_OF_ISAAC.fullmatch(each.block.stem) for each in found):
        return found
    draft.unused += [
        f"{name_of(each)}: by Isaac Lab's observations relative to the default pose; its states are not"
        for each in found if each.block.stem == _RELATIVE
    ]  # fmt: skip
    return [each for each in found if each.block.stem != _RELATIVE]


def as_input_and_output(found: list[NamedBlock]) -> list[NamedBlock]:
    """Input `u` and output `y` of system identification, as benchmarks name them: efforts and positions.

    Where no name says position, and both have as many columns; `y_ref` is what the output should have been.
    """
    if any(each.meaning.quantity == "position" and not each.meaning.commanded for each in found):
        return found
    read = [each for each in found if is_output(each) and not each.meaning.commanded]
    inputs = [each for each in found if words_in(each.block.stem)[:1] == ["u"]]
    sizes = {len(each.block.labels) for each in read} & {len(each.block.labels) for each in inputs}
    out = []
    for each in found:
        told = each.meaning
        if len(each.block.labels) in sizes and not told.quantity:
            if is_output(each):
                told = replace(told, quantity="position")
            elif each in inputs:
                told = replace(told, quantity="effort", commanded=False)
        out.append(each if told is each.meaning else replace(each, meaning=told))
    return out


def is_output(each: NamedBlock) -> bool:
    """Whether a block is called as the output of a system is."""
    return words_in(each.block.stem)[:1] == ["y"]


def by_one_unit(
    best: NamedBlock, rivals: Sequence[NamedBlock], draft: Draft
) -> tuple[NamedBlock, list[NamedBlock]]:
    """The same angle in deg and in rad is one: the column whose name says its unit, and the other rivals."""
    same = [each for each in rivals if _is_same_angle(each, best)]
    left = [each for each in rivals if each not in same]
    told = next((each for each in (best, *same) if each.meaning.unit in ("rad", "deg")), best)
    draft.unused += [f"{name_of(e)}: {name_of(told)} once more" for e in (best, *same) if e is not told]
    return told, left


def _is_same_angle(one: NamedBlock, other: NamedBlock) -> bool:
    first, second = one.block.values, other.block.values
    if first.shape != second.shape or one.part is not other.part or not first.any():
        return False
    return any(np.allclose(first, k * second, rtol=0.0, atol=_SAME * np.abs(first).max()) for k in _UNITS)


def label_by_name(each: NamedBlock, order: Sequence[str]) -> NamedBlock:
    """A block whose columns are numbered, labelled as the positions are: `joint1_pos` stands beside `tau1`.

    Numbers are those that the joints' names end with; what a log of one joint numbers or not is of that one.
    """
    labels = each.block.labels
    if set(order) <= set(labels) or any(label and not label.isdecimal() for label in labels):
        return each
    number = {m[1]: joint for joint in order if (m := re.search(r"(\d+)\D*$", joint))}
    if len(order) == len(labels) == 1:
        named = tuple(order)
    elif len(number) == len(order) and set(number) == set(labels):
        named = tuple(number[label] for label in labels)
    else:
        return each
    return replace(each, block=replace(each.block, labels=named))


def asked_of_still(position: NamedBlock) -> str:
    """What is asked of joints whose every number is zero beside others': places of a message, as it seems."""
    zero = np.asarray(~position.block.values.any(axis=0))
    still = [label for label, is_zero in zip(position.block.labels, zero, strict=True) if is_zero]
    if not still or zero.all():
        return ""
    said = "are zero throughout: do they stand still? What nothing measures is to be taken out"
    return f"{', '.join(still)} {said}"


def nothing_measured(found: Sequence[NamedBlock]) -> str:
    """Why no position was found, and what to do about it."""
    columns = [f"{c.part.path.name}: {name}" for c in found for name in c.block.columns]
    if not columns:
        return "the log holds no columns of numbers; name the file of the motion"
    if len(columns) == 1:
        return (
            f"{columns[0]} is one column, and nothing to compare it with is beside it: a second clock's"
            " stamps, the true distance, a command; columns need names in a first line, such as device,host"
            " or time,position"
        )
    shown = ", ".join(columns[:_SHOWN]) + (", ..." if len(columns) > _SHOWN else "")
    if all(name.isdecimal() for c in found for name in c.block.columns):
        return f"{shown} have no names; name the columns in a first line, such as time,q1,q2,tau1,tau2"
    text = any(is_text_table(each.part.path) for each in found)
    where = "say in the first line what columns hold" if text else "call arrays as what they hold"
    return (
        f"no measured position was found among {shown}; {where}, such as"
        " time,position,target,torque, write the mapping by hand, or name the robot's URDF by --urdf if"
        " columns are called as its joints are"
    )
