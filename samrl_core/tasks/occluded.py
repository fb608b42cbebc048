"""Variants of the tasks in which a screen hides the goal from many views, the start view among them.

The screens were found by search: at least half of the views that the camera arm reaches do not see the goal,
the tool keeps clear of them on its way from every start, and views on the far side stay free. A screen must
stand aside from hand and arm, so that none hides what is seen from steeply above: where that is many of the
views, these are left out.
"""

from __future__ import annotations

from samrl_core.tasks.task import Task

OCCLUDED = "_occluded"  # ends the names of the variants


def occluded() -> tuple[Task, ...]:
    """One variant of each task."""
    return ()
