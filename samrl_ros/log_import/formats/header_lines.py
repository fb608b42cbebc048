"""Several lines of names above a table, as pandas writes a MultiIndex of columns, or merged cells a sheet.

Above `p,v,p,v` stands `hip,hip,knee,knee` or `hip,,knee,`: columns are called `hip_p`, `hip_v`, `knee_p`.
Where pandas writes a line for the index's name alone, that is the name of the first column.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from samrl_ros.log_import.table import NUMBER

_NUMBER = re.compile(NUMBER, re.IGNORECASE)
_UNNAMED = re.compile(r"Unnamed: \d+(_level_\d+)?")  # what pandas writes for an empty cell that it has read
_MOST = 5  # lines of names


def join_names(lines: Sequence[Sequence[str]]) -> list[str]:
    """Names of the columns of a table below lines of names, the outermost group first.

    Args:
        lines: of cells, each as many as the table has columns.
    """
    levels, index = _without_index(lines)
    filled: list[list[str]] = []
    starts = [False] * len(levels[0])  # of a group above
    for cells in levels[:-1]:
        level = _spread(cells, starts)
        starts = [begun or bool(cell) for begun, cell in zip(starts, cells, strict=True)]
        filled.append(level)
    filled.append(levels[-1])
    names = ["_".join(part for part in parts if part) for parts in zip(*filled, strict=True)]
    return [*index, *names[len(index) :]]


def count_name_lines(above: Sequence[Sequence[str]], width: int) -> int:
    """How many lines right above a table are names of groups and of what is in them; 0 where there is none.

    Args:
        above: cells of the lines above the table.
        width: cells of its rows.
    """
    found: list[list[str]] = []
    for cells in reversed(above[-_MOST:]):
        if len(cells) != width or holds_row(cells) or not any(cells) or repeated_key(cells):
            break
        found.insert(0, _known(cells))
    while len(found) > 1 and not _are_names(found):
        found.pop(0)
    return len(found) if len(found) > 1 else 0


def repeated_key(cells: Sequence[str]) -> str:
    """The key that every filled cell of a line repeats, as `Unit` in `,Unit: deg,Unit: V`; else empty.

    Simulink's Data Inspector writes types, units, interpolation and more so below the names.
    """
    parted = [cell.partition(": ") for cell in cells if cell.strip()]
    keys = {key.strip() for key, _, _ in parted}
    return keys.pop() if len(keys) == 1 and all(mark for _, mark, _ in parted) else ""


def holds_row(cells: Sequence[str]) -> bool:
    """Whether a line is one of numbers; numbers of groups leave the first column without one."""
    filled = [cell for cell in cells if cell.strip()]
    numbers = [cell for cell in filled if _NUMBER.fullmatch(cell.strip())]
    return bool(numbers) and 2 * len(numbers) > len(filled) and cells[0] in numbers


def _are_names(lines: Sequence[Sequence[str]]) -> bool:
    """Whether the first line names groups, and all of them tell the columns apart."""
    levels, index = _without_index(lines)
    if len(levels) < 2:
        return False
    names, groups, last = join_names(lines), levels[0], levels[-1]
    if len(set(names)) < len(names) or not all(names[1:]) or not all(last[max(1, len(index)) :]):
        return False
    if len(set(last)) == len(last) and all(last) and (groups[0] or not _repeats(groups)):
        return False  # names by themselves, below a title, units or types
    if _repeats(groups):
        return True
    spread = _spread(groups, [False] * len(groups))
    own = [group for k, group in enumerate(groups) if group and (last[k] or k)]
    return _repeats(spread) and (len(own) > 1 or not (groups[0] and last[0]))


def _without_index(lines: Sequence[Sequence[str]]) -> tuple[list[list[str]], list[str]]:
    """Lines of names without that of the index, and the index's names; none where there is no such line."""
    levels = [_known(cells) for cells in lines]
    last = levels[-1]
    count = next((k for k, cell in enumerate(last) if not cell), len(last))
    if len(levels) > 2 and 0 < count < len(last) and not any(last[count:]):
        return levels[:-1], last[:count]
    return levels, []


def _spread(cells: Sequence[str], starts: Sequence[bool]) -> list[str]:
    """Names of groups on each of their columns: as they are where they repeat, else up to the next one."""
    if _repeats(cells):
        return list(cells)
    out: list[str] = []
    for k, cell in enumerate(cells):
        out.append(cell or ("" if not k or starts[k] else out[-1]))
    return out


def _repeats(cells: Sequence[str]) -> bool:
    return any(one and one == other for one, other in zip(cells[:-1], cells[1:], strict=True))


def _known(cells: Sequence[str]) -> list[str]:
    return ["" if _UNNAMED.fullmatch(cell.strip()) else cell.strip() for cell in cells]
