"""Variants of the tasks in which a screen hides the goal from many views, the start view among them.

The screens were found by search: at least half of the views that the camera arm reaches do not see the goal,
the tool keeps clear of them on its way from every start, and every start can be seen from somewhere. They
must stand aside from hand and arm, so that they hide nothing that is seen from steeply above: where that
would be most of the views, these are left out.
"""

from __future__ import annotations

import math
from dataclasses import replace

from samrl_core.tasks.needle_threading.task import NeedleThreading
from samrl_core.tasks.peg_insertion.task import PegInsertion
from samrl_core.tasks.screen import beside, fence
from samrl_core.tasks.spatula_flipping.task import SpatulaFlipping
from samrl_core.tasks.task import Task

OCCLUDED = "_occluded"  # ends the names of the variants


def occluded() -> tuple[Task, ...]:
    """One variant of each task."""
    return _peg(), _flipping(), _threading()


def _peg() -> Task:
    """A fence towards the start view, a wide plate on the other side.

    Which gap shows the hole depends on where it lies: no view of the grid sees more than 7 of 10 places.
    """
    task = PegInsertion()
    target = task.view_region().target
    slats = fence(target, math.radians(45.0), 0.16, 0.03, 0.24, gap=0.02, slats=range(-2, 4))
    plate = beside(target, math.radians(-75.0), 0.22, 0.40, 0.24)
    return replace(
        task,
        name=task.name + OCCLUDED,
        view_elevation=(math.radians(20.0), math.radians(34.0)),
        screens=(*slats, plate),
    )


def _flipping() -> Task:
    """A fence towards the start view, a wide plate on the other side.

    A gap shows the pancake as it lies, or where it turns, or as it lies in the end, but not all of these.
    """
    task = SpatulaFlipping()
    target = task.view_region().target
    slats = fence(target, math.radians(60.0), 0.12, 0.12, 0.24, gap=0.06, slats=range(-1, 2))
    plate = beside(target, math.radians(-90.0), 0.20, 0.40, 0.24, shift=0.08)
    return replace(
        task,
        name=task.name + OCCLUDED,
        view_elevation=(math.radians(20.0), math.radians(34.0)),
        screens=(*slats, plate),
    )


def _threading() -> Task:
    """Two plates."""
    task = NeedleThreading()
    target = task.view_region().target
    plates = (
        beside(target, math.radians(45.0), 0.10, 0.30, 0.32),
        beside(target, math.radians(-75.0), 0.18, 0.25, 0.32),
    )
    return replace(task, name=task.name + OCCLUDED, screens=plates)
