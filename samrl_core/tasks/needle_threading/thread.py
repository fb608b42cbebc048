"""Where a thread, a line of points from the gripped end to the loose one, passes a horizontal plane."""

from __future__ import annotations

import numpy as np


def length_below(points: np.ndarray, height: float) -> float:
    """Length of the thread from its loose end up to its first passage of z = `height` [m]; 0 above it.

    Args:
        points: (K + 1, 3) [m].
        height: of the plane [m].
    """
    length = 0.0
    for lower, upper in zip(points[:0:-1], points[-2::-1], strict=True):
        if lower[2] > height:
            return length
        piece = float(np.linalg.norm(upper - lower))
        if upper[2] > height:
            return length + piece * float((height - lower[2]) / (upper[2] - lower[2]))
        length += piece
    return length


def point_at(points: np.ndarray, length: float) -> np.ndarray:
    """Point (3,) of the thread at a length from its loose end [m]; its gripped end when that is too long."""
    for lower, upper in zip(points[:0:-1], points[-2::-1], strict=True):
        piece = float(np.linalg.norm(upper - lower))
        if length <= piece:
            return lower + (upper - lower) * (length / piece)
        length -= piece
    return points[0]


def crossing_distance(points: np.ndarray, eye: np.ndarray) -> float:
    """Horizontal distance from the eye's centre (3,) to where the thread passes its plane [m].

    Of a thread that hangs above the plane, the distance of its loose end counts.
    """
    place = point_at(points, length_below(points, float(eye[2])))
    return float(np.linalg.norm(place[:2] - eye[:2]))
