"""Positions of a described arm's joints among the columns of a table that holds a pose as well."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from samrl_ros.log_import.draft.blocks import counts_rows, numbers_of
from samrl_ros.log_import.draft.column_names import is_time, meaning, split_names, words_in
from samrl_ros.log_import.draft.tracks.found_track import Component
from samrl_ros.log_import.table import Table

MOST_JOINTS = 9
_TORQUES = frozenset(("effort", "current", "voltage"))


@dataclass(frozen=True, eq=False)
class JointColumns:
    """A column for each of some joints, in their order."""

    joints: tuple[str, ...]  # of the description
    parts: tuple[Component, ...]  # one per joint
    values: np.ndarray  # (N, J) as logged
    unit: str  # rad or deg; empty where no name says it
    by_name: bool  # else by their order
    names: str  # for sentences


def find_joint_columns(table: Table, joints: Sequence[str], used: Sequence[str]) -> list[JointColumns]:
    """Every set of columns that may be measured positions of an arm's joints, those named as joints first.

    Args:
        table: of the log.
        joints: of the description, from the base on.
        used: columns of the pose beside them.
    """
    flat, found = [], []
    for name in table.columns:
        values = None if name in used or is_time(name) else numbers_of(table, name)
        if values is None:
            continue
        if values.ndim == 1 and not counts_rows(values):
            flat.append(name)
        elif values.ndim == 2 and 1 < values.shape[1] <= len(joints) and _is_position(name):
            if (np.nanmin(values, axis=0) == np.nanmax(values, axis=0)).all():
                continue  # a camera's intrinsics in every row
            parts = tuple(Component(name, k) for k in range(values.shape[1]))
            of = tuple(joints[: values.shape[1]])
            found.append(JointColumns(of, parts, values, _unit(name, name, table), False, name))
    for stem, members in split_names(flat, joints).items():
        labels = dict(members)
        if len(labels) < 2 or not _is_position(stem):
            continue
        by_name = set(labels) <= set(joints)
        if not by_name and not (all(label.isdecimal() for label in labels) and len(labels) <= len(joints)):
            continue
        of = tuple(joint for joint in joints if joint in labels) if by_name else tuple(joints[: len(labels)])
        columns = [labels[joint] for joint in of] if by_name else [labels[k] for k in sorted(labels, key=int)]
        values = np.column_stack([table.numbers(name, "the log") for name in columns])
        parts, unit = tuple(Component(name) for name in columns), _unit(stem, columns[0], table)
        found.append(JointColumns(of, parts, values, unit, by_name, ", ".join(columns)))
    return sorted(found, key=lambda each: not each.by_name)


def has_torques(table: Table) -> bool:
    """Whether any column is a motor's torque, current or voltage."""
    return any(meaning(name).quantity in _TORQUES for name in table.columns)


def likely_joints(table: Table, used: Sequence[str]) -> list[str]:
    """Columns that look like joints of an arm that nobody described; none beside commands or velocities.

    Args:
        table: of the log.
        used: columns of the pose beside them.
    """
    others = [name for name in table.columns if name not in used]
    said = [meaning(name) for name in others]
    if any(each.commanded or each.quantity == "velocity" for each in said):
        return []
    named = [name for name in others if {"joint", "joints"} & set(words_in(name)) and _is_position(name)]
    unnamed = tuple(f"joint {k}" for k in range(MOST_JOINTS))
    sets = [[part.column for part in each.parts] for each in find_joint_columns(table, unnamed, used)]
    return max([named, *sets], key=len)


def _unit(stem: str, column: str, table: Table) -> str:
    said = meaning(stem).unit or table.units.get(column, "")
    return said if said in ("rad", "deg") else ""


def _is_position(stem: str) -> bool:
    said = meaning(stem)
    return said.quantity in ("", "position") and not said.commanded and not said.computed
