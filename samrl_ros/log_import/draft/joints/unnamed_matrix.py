"""A matrix without names, as data of inverse dynamics are published: which of its columns are what.

SARCOS' has 28: positions, velocities, accelerations and torques of seven joints. Nothing but the numbers
tells: a velocity is the derivative of the position, whatever the rate.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from samrl_ros.log_import.draft import evidence
from samrl_ros.log_import.draft.blocks import LogBlock
from samrl_ros.log_import.draft.column_names import SLOT, NameMeaning
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.joints.named_sources import NamedBlock

_PLACEHOLDER_HZ = 100.0  # correlations do not depend on it
_FOLLOWS = 0.98  # correlation from which columns are positions once more: commanded, or of another encoder
_GROUP = re.compile(r"\[\d+:\d+\]$")
_ROLES = ("position", "velocity", "acceleration", "effort")


def split_matrix(found: list[NamedBlock], joints: Sequence[str], draft: Draft) -> list[NamedBlock]:
    """The columns of the log's only block as blocks of as many columns as the description has joints.

    Only where neither array nor columns have names that say what they are, and one group of columns is the
    derivative of another. A first column that grows by even steps is the time. What is left over beside
    positions once more is the torque if it is one group, and nothing if it is several.

    Args:
        found: blocks of the log.
        joints: of the robot's description.
        draft: to which reason and question are added.
    """
    count = len(joints)
    if len(found) != 1 or count < 2 or found[0].meaning != NameMeaning():
        return found
    block = found[0].block
    array = len(block.columns) == 1
    unnamed = array or (block.stem == SLOT and all(name.isdecimal() for name in block.columns))
    if block.transposed or not unnamed:
        return found
    width = block.values.shape[1]
    first = 1 if width % count == 1 and _is_clock(block.values[:, 0]) else 0
    if (width - first) % count or width - first < 2 * count:
        return found
    groups = [block.values[:, at : at + count] for at in range(first, width, count)]
    roles = _roles(groups)
    if "velocity" not in roles:
        return found
    name = block.columns[0] if array else ""
    blocks = [_part_of(block, first + k * count, count, name) for k in range(len(groups))]
    clock = (f"{name}[0]" if array else block.columns[0],) if first else ()
    part = replace(found[0].part, blocks=tuple(blocks), times=clock or found[0].part.times)
    said = ", ".join(f"{one.stem}: {role or 'left out'}" for one, role in zip(blocks, roles, strict=True))
    draft.note(
        "channels.states.position",
        f"columns without names, in groups of {count} as the URDF has joints",
        f"is each group what it is taken for, {said}?",
    )
    return [
        NamedBlock(part, one, NameMeaning(quantity=role, measured=role != ""))
        for one, role in zip(blocks, roles, strict=True)
    ]  # fmt: skip


def is_group(each: NamedBlock) -> bool:
    """Whether a block is columns of such a matrix, whose role no name says."""
    return _GROUP.search(each.block.stem) is not None


def _is_clock(values: np.ndarray) -> bool:
    steps = np.diff(values)
    return bool((steps > 0).all() and evidence.time_unit(steps))


def _part_of(block: LogBlock, at: int, count: int, name: str) -> LogBlock:
    labels = tuple(str(k) for k in range(count))
    columns = (name,) if name else block.columns[at : at + count]
    stem = f"{name or 'columns'}[{at}:{at + count}]"
    values = block.values[:, at : at + count]
    return replace(block, stem=stem, labels=labels, columns=columns, values=values, first=at if name else 0)


def _roles(groups: Sequence[np.ndarray]) -> list[str]:
    """What each group (N, J) is; empty where nothing tells, and all empty where none is another's rate."""
    time = np.arange(len(groups[0])) / _PLACEHOLDER_HZ
    roles = [""] * len(groups)
    at = next((k for k, one in enumerate(groups) if _rate_of(time, one, groups, {k}) is not None), None)
    taken: set[int] = set()
    for role in _ROLES[:3]:
        if at is None:
            break
        roles[at] = role
        taken.add(at)
        at = _rate_of(time, groups[at], groups, taken)
    rest = [k for k in range(len(groups)) if k not in taken and np.ptp(groups[k]) > 0]
    if "position" in roles:
        q = groups[roles.index("position")]
        rest = [k for k in rest if evidence.follows(time, q, time, groups[k]) < _FOLLOWS]
    if len(rest) == 1 and "velocity" in roles:
        roles[rest[0]] = "effort"
    return roles


def _rate_of(time: np.ndarray, one: np.ndarray, groups: Sequence[np.ndarray], taken: set[int]) -> int | None:
    """The group that is most surely another's derivative; None where none is."""
    fits = {
        k: fit.correlation
        for k, other in enumerate(groups)
        if k not in taken and (fit := evidence.fit_rate(time, one, other)).ratio > 0
    }
    best = max(fits, key=lambda k: fits[k], default=None)
    return best if best is not None and fits[best] >= evidence.AGREES else None
