"""Cells by name. A new cell is a file here with one `CellSpec`, and a line in `CELLS`."""

from __future__ import annotations

from samrl_core.cell.robots.cells.panda_rizon import PANDA_RIZON
from samrl_core.cell.robots.robot import ROLES, CellSpec, RobotSpec
from samrl_core.common.errors import InputError

CELLS: dict[str, CellSpec] = {cell.name: cell for cell in (PANDA_RIZON,)}
DEFAULT_CELL = PANDA_RIZON.name


def cell_named(name: str = DEFAULT_CELL) -> CellSpec:
    """The cell of that name.

    Raises:
        InputError: there is no such cell.
    """
    if name not in CELLS:
        raise InputError(f"no cell is named {name!r}; there are: {', '.join(sorted(CELLS))}")
    return CELLS[name]


def robots() -> dict[str, RobotSpec]:
    """The arms of all cells by name."""
    return {spec.name: spec for cell in CELLS.values() for spec in map(cell.arm, ROLES)}


def robot_with_joints(joint_names: tuple[str, ...]) -> RobotSpec | None:
    """The arm whose joints have these names, base first; None if no cell has one."""
    return next((spec for spec in robots().values() if spec.joint_names == joint_names), None)
