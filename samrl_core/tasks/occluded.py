"""Variants of the tasks in which a screen hides the goal from many views, the start view among them.

The screens were found by search: at least half of the views that the camera arm reaches do not see the goal,
the tool keeps clear of them on its way from every start, and views on the far side stay free. A screen must
stand aside from hand and arm, so that none hides what is seen from steeply above: where that is many of the
views, these are left out.
"""

from __future__ import annotations

import math
from dataclasses import replace

from samrl_core.tasks.needle_threading.task import NeedleThreading
from samrl_core.tasks.peg_insertion.task import PegInsertion
from samrl_core.tasks.screen import Screen, beside
from samrl_core.tasks.spatula_flipping.task import SpatulaFlipping
from samrl_core.tasks.task import Task

OCCLUDED = "_occluded"  # ends the names of the variants


def occluded() -> tuple[Task, ...]:
    """One variant of each task."""
    peg, flip, thread = PegInsertion(), SpatulaFlipping(), NeedleThreading()
    return (
        replace(
            peg,
            name=peg.name + OCCLUDED,
            view_elevation=(math.radians(20.0), math.radians(45.0)),
            screens=_screens(peg, (45.0, 0.16, 0.35, 0.24), (-90.0, 0.20, 0.50, 0.24)),
        ),
        replace(
            flip,
            name=flip.name + OCCLUDED,
            screens=_screens(flip, (60.0, 0.12, 0.35, 0.34), (-75.0, 0.18, 0.25, 0.28)),
        ),
        replace(
            thread,
            name=thread.name + OCCLUDED,
            screens=_screens(thread, (45.0, 0.10, 0.30, 0.32), (-75.0, 0.18, 0.25, 0.32)),
        ),
    )


def _screens(task: Task, *plates: tuple[float, float, float, float]) -> tuple[Screen, ...]:
    """Plates by azimuth [deg] and distance [m] from the middle of the views, width and height [m]."""
    target = task.view_region().target
    return tuple(beside(target, math.radians(azimuth), *rest) for azimuth, *rest in plates)
