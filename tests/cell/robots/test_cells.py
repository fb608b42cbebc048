"""Cells by name, and the arms that they bring."""

from __future__ import annotations

import importlib
import pkgutil

import pytest

from samrl_core.cell.robots import cells
from samrl_core.cell.robots.cells import CELLS, DEFAULT_CELL, cell_named, robot_with_joints, robots
from samrl_core.cell.robots.robot import ROLES, CellSpec
from samrl_core.common.errors import InputError


def test_every_file_of_the_folder_is_a_cell_of_the_registry() -> None:
    files = [module.name for module in pkgutil.iter_modules(cells.__path__)]
    found = [
        value
        for name in files
        for value in vars(importlib.import_module(f"{cells.__name__}.{name}")).values()
        if isinstance(value, CellSpec)
    ]
    assert sorted(cell.name for cell in found) == sorted(CELLS) == sorted(files)


def test_names() -> None:
    assert cell_named() is cell_named(DEFAULT_CELL) is CELLS[DEFAULT_CELL]
    with pytest.raises(InputError, match=rf"no cell is named 'nope'; there are: .*{DEFAULT_CELL}"):
        cell_named("nope")


def test_arms_are_found_by_their_joints() -> None:
    for cell in CELLS.values():
        for role in ROLES:
            spec = cell.arm(role)
            assert robots()[spec.name] is spec
            assert robot_with_joints(spec.joint_names) is spec
    assert robot_with_joints(("elbow",)) is None
