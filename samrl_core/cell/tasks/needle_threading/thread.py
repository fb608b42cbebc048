"""A thread as a line of points from the gripped end to the loose one: bends, lengths, and where it passes."""

from __future__ import annotations

import math

import numpy as np


def length_below(points: np.ndarray, height: float) -> float:
    """Length of the thread from its loose end up to its first passage of z = `height` [m]; 0 above it.

    Args:
        points: (K + 1, 3) [m].
        height: of the plane [m].
    """
    upwards = points[::-1]
    above = np.flatnonzero(upwards[:, 2] > height)
    crossing = int(above[0]) if len(above) else len(points)
    if crossing == 0:
        return 0.0
    length = float(np.linalg.norm(np.diff(upwards[:crossing], axis=0), axis=1).sum())
    if crossing < len(points):
        lower, upper = upwards[crossing - 1], upwards[crossing]
        length += float(np.linalg.norm(upper - lower) * (height - lower[2]) / (upper[2] - lower[2]))
    return length


def points_at(points: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Points (N, 3) of the thread at lengths (N,) from its loose end [m]; its gripped end when too long."""
    upwards = points[::-1]
    pieces = np.linalg.norm(np.diff(upwards, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(pieces)])
    return np.stack([np.interp(lengths, along, upwards[:, i]) for i in range(3)], axis=1)


def point_at(points: np.ndarray, length: float) -> np.ndarray:
    """Point (3,) of the thread at a length from its loose end [m]; its gripped end when that is too long."""
    return points_at(points, np.array([length]))[0]


def crossing_offset(points: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """From the eye's centre (3,) to where the thread passes its plane, in x and y (2,) [m].

    Of a thread that hangs above the plane, its loose end counts.
    """
    return (point_at(points, length_below(points, float(eye[2]))) - eye)[:2]


def crossing_distance(points: np.ndarray, eye: np.ndarray) -> float:
    """Length of `crossing_offset` [m]."""
    return float(np.linalg.norm(crossing_offset(points, eye)))


def hanging_length(points: np.ndarray, depth: float, step: float, whole: float) -> float:
    """Length from the loose end, in steps, of the first point that lies `depth` above the end [m].

    Args:
        points: (K + 1, 3) [m].
        depth: [m].
        step: between lengths that are tried [m].
        whole: length of the thread, which is given where none lies so high [m].
    """
    lengths = np.arange(step, whole, step)
    deep = points_at(points, lengths)[:, 2] - points[-1, 2] >= depth
    return float(lengths[deep][0]) if deep.any() else whole


def bend_angles(points: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Angles (2 K,) about x and y of each link [rad] of a thread whose joints and end lie at `points`.

    Args:
        points: (K + 1, 3) [m].
        turn: (3, 3) rotation of what it hangs from.
    """
    values = []
    for step in np.diff(points, axis=0):
        # Direction of the link in the frame of the one before: Rx(a) Ry(b) z.
        d = turn.T @ (step / np.linalg.norm(step))
        about_y = math.asin(float(np.clip(d[0], -1.0, 1.0)))
        about_x = math.atan2(-d[1], d[2])
        values += [about_x, about_y]
        turn = turn @ _about_x(about_x) @ _about_y(about_y)
    return np.array(values)


def _about_x(angle: float) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def _about_y(angle: float) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
