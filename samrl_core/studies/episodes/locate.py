"""Where things are by one image and plain fits: what somebody writes in an afternoon.

Depth is unprojected with the calibration as it is believed; a circle is fitted to the outline of what has a
label, a loose end is its lowest points. No model is rendered and nothing is known of errors.
"""

from __future__ import annotations

import cv2
import numpy as np

from samrl_core.cell.tasks.needle_threading.task import NeedleThreading
from samrl_core.cell.tasks.peg_insertion.task import PegInsertion
from samrl_core.cell.tasks.spatula_flipping.task import SpatulaFlipping
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.observation import Observation
from samrl_core.common.errors import InputError

_FLAT = 0.006  # what lies so near to a drawn height is of that face [m]
_LOOSE = 0.004  # points so near above the lowest are the thread's end [m]
_FEWEST = 6  # points of a fit


def locate_parts(task: Task, observation: Observation, tip: np.ndarray) -> tuple[Task, np.ndarray]:
    """The task, with a needle where it was found, and its parameters (P,) by one image.

    What cannot be seen, or has too few points, stays as drawn.

    Args:
        task: one of the three.
        observation: image and camera.
        tip: of the tool (3,) in the tool arm's base frame [m].

    Raises:
        InputError: a task that nobody has written a script for.
    """
    values = np.array([p.nominal for p in task.parameters()])
    points = observation.camera.unproject(observation.frame.depth.astype(np.float64))
    mask = observation.frame.mask
    if isinstance(task, PegInsertion):
        top = _at_height(points[mask == task.board_label], task.height)
        values[:2] = _circle(top, values[:2])
        return task, values
    if isinstance(task, SpatulaFlipping):
        seen = points[mask == task.pancake_label]
        top = _at_height(seen, task.pancake_thickness + plate_height(task, observation))
        values[:2] = _circle(top, values[:2])
        return task, values
    if isinstance(task, NeedleThreading):
        return _threading(task, points, mask, tip)
    raise InputError(f"no script knows task {task.name}; there are scripts for peg, pancake and thread")


def plate_height(task: SpatulaFlipping, observation: Observation) -> float:
    """Of what the pancake lies on, over the drawn one [m], where it is unknown: middle depth of its face."""
    points = observation.camera.unproject(observation.frame.depth.astype(np.float64))
    heights = points[observation.frame.mask == task.pancake_label][:, 2]
    heights = heights[np.isfinite(heights)]
    if task.surface_deviation == 0.0 or len(heights) < _FEWEST:
        return 0.0
    return float(np.median(heights)) - task.pancake_thickness


def _threading(
    task: NeedleThreading, points: np.ndarray, mask: np.ndarray, tip: np.ndarray
) -> tuple[Task, np.ndarray]:
    """A thread taken for a straight line to its loose end, and the ring's middle for the eye."""
    values, count = np.array([p.nominal for p in task.parameters()]), 2 * task.links
    ring = _at_height(points[mask == task.needle_label], task.eye_z)
    if len(ring) >= _FEWEST:  # the post stands at its +y side, so the other edge is the ring's own
        low, high = np.quantile(ring[:, :2], 0.05, axis=0), np.quantile(ring[:, :2], 0.95, axis=0)
        place = np.array([0.5 * (low[0] + high[0]), low[1] + task.eye_outer_radius])
        if task.finds_needle:
            values[count : count + 2] = place
        else:
            task = task.with_needle_at(place)
    thread = points[mask == task.thread_label]
    thread = thread[np.isfinite(thread).all(axis=1)]
    near = np.linalg.norm(thread - tip, axis=1) < 1.2 * task.links * task.link_length
    thread = thread[near]
    if len(thread) < _FEWEST:
        return task, values
    lowest = np.quantile(thread[:, 2], 0.05)
    way = thread[thread[:, 2] < lowest + _LOOSE].mean(axis=0) - tip
    way *= task.link_length / np.linalg.norm(way)
    values[:count] = task.values_of(tip + np.arange(task.links + 1)[:, None] * way)
    return task, values


def _at_height(points: np.ndarray, height: float) -> np.ndarray:
    """Those of the points (N, 3) that lie on a horizontal face [m]."""
    return points[np.abs(points[:, 2] - height) < _FLAT]


def _circle(points: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
    """Centre (2,) of the least circle about points (N, 3) seen from above [m]."""
    if len(points) < _FEWEST:
        return otherwise
    middle = points[:, :2].mean(axis=0)  # OpenCV works in float32
    (x, y), _ = cv2.minEnclosingCircle((1e3 * (points[:, :2] - middle)).astype(np.float32))
    return middle + 1e-3 * np.array([x, y])
