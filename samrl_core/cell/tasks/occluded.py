"""Variants of the tasks in which a screen hides the goal from many views, the start view among them.

The screens were found by search: at least half of the views that the camera arm reaches do not see the goal,
the tool keeps clear of them on its way from every start, and what must be seen can be seen from somewhere at
any time, but not always from the same view. Screens must stand aside from hand and arm and so hide nothing
that is seen from steeply above: these views are left out.
"""

from __future__ import annotations

import math
from dataclasses import replace

from samrl_core.cell.tasks.needle_threading.task import NeedleThreading
from samrl_core.cell.tasks.peg_insertion.task import PegInsertion
from samrl_core.cell.tasks.screen import Screen, beside, fence
from samrl_core.cell.tasks.spatula_flipping.task import SpatulaFlipping
from samrl_core.cell.tasks.task import Task

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
    return _variant(task, (*slats, plate))


def _flipping() -> Task:
    """Low walls on both sides: whoever looks over one of them sees the far side, not what lies close behind.

    A pancake that lies within a centimetre of the middle is turned over by one who sees nothing, for the lip
    takes up what the blade misses: up to 4 cm across in the model. So here it may lie 8 cm off to either
    side, and the blade is narrow: the tests' expert fails where it believes the pancake 3 cm off.
    """
    task = SpatulaFlipping(half_range=(0.010, 0.080), blade_width=0.030, lip_size=(0.006, 0.300, 0.012))
    target, apart, distance = task.view_region().target, math.radians(27.0), 0.24
    width = 2.0 * distance * math.tan(0.5 * apart) + 0.004  # neighbours meet
    walls = [
        beside(target, side * (math.radians(14.0) + k * apart), distance, width, 0.20)
        for side in (1.0, -1.0)
        for k in range(4)
    ]
    return _variant(task, tuple(walls))


def _threading() -> Task:
    """A fence towards the start view, a wide plate on the other side.

    The eye stands still, so that some views always show it; none shows all threads that hang beside it.
    """
    task = NeedleThreading()
    target = task.view_region().target
    slats = fence(target, math.radians(45.0), 0.10, 0.034, 0.28, gap=0.026, slats=range(-2, 3), shift=0.015)
    plate = beside(target, math.radians(-60.0), 0.20, 0.40, 0.34)
    return _variant(task, (*slats, plate))


def _variant(task: PegInsertion | SpatulaFlipping | NeedleThreading, screens: tuple[Screen, ...]) -> Task:
    """Without the views from steeply above."""
    elevation = (math.radians(20.0), math.radians(34.0))
    return replace(
        task, name=task.name + OCCLUDED, variant_of=task.name, view_elevation=elevation, screens=screens
    )
