"""Names of joints that a table holds as text beside their numbers, as tools write a JointState into CSV.

`field.position0` of `rostopic echo -p` is of the joint that `field.name0` names in every row, and
`position[0]` of the first in a column of lists, `name`: `['j1', 'j2']`. Drivers sort joints by name as
often as from the base on.
"""

from __future__ import annotations

import re
from dataclasses import replace

import pandas as pd

from samrl_ros.log_import.draft.blocks import LogPart
from samrl_ros.log_import.draft.column_names import words_in
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.joints.named_sources import NamedBlock
from samrl_ros.log_import.table import list_in

_QUOTED = re.compile(r"""(['"])(.*?)\1""")
_NAMES = ("name", "names")


def name_joints(found: list[NamedBlock], draft: Draft) -> list[NamedBlock]:
    """Blocks whose numbered columns have the names that stand beside them; others as they are.

    Args:
        found: blocks of the log.
        draft: to which the reason is added.
    """
    named = {id(each.part): names_beside(each.part) for each in found}
    out = []
    for each in found:
        names = named[id(each.part)]
        labels = each.block.labels
        if labels and set(labels) <= set(names):
            own = tuple(names[label] for label in labels)
            each = replace(each, block=replace(each.block, labels=own))
        out.append(each)
    if any(a is not b for a, b in zip(out, found, strict=True)):
        first = next(names for names in named.values() if names)
        said = ", ".join(f"{label} is {name}" for label, name in first.items())
        draft.note("joints", f"the log's own columns of names: {said}")
    return out


def names_beside(part: LogPart) -> dict[str, str]:
    """The joint of each number in columns' names, or in a list; empty unless it is the same in every row."""
    names: dict[str, str] = {}
    for column, cells in part.table.columns.items():
        words = words_in(column)
        if not isinstance(cells, pd.Series) or not words:
            continue
        if words[-1] in _NAMES and (listed := _names_in_lists(cells)):
            return listed
        if len(words) < 2 or words[-2] not in _NAMES:
            continue
        told = {str(cell).strip() for cell in cells}
        if not words[-1].isdecimal() or len(told) != 1 or not (name := told.pop()):
            return {}
        names[words[-1]] = name
    return names if len(set(names.values())) == len(names) else {}


def _names_in_lists(cells: pd.Series) -> dict[str, str]:
    """The joint of each place in lists, `['j1', 'j2']`; empty where rows differ, or hold no such list."""
    told = set(cells.astype(str))
    inner = list_in(told.pop()) if len(told) == 1 else None
    names = [name for _, name in _QUOTED.findall(inner or "")]
    return {str(k): name for k, name in enumerate(names)} if len(set(names)) == len(names) else {}
