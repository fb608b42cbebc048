"""Poses in columns without names, by what their numbers look like."""

from __future__ import annotations

import numpy as np

from samrl_ros.log_import.draft.tracks.found_track import LEAST, Component, FoundTrack, matrix_parts
from samrl_ros.log_import.table import Table

_UNIT_LENGTH = 0.01  # by which a quaternion's length may differ from 1
_STATES = (13, 19)  # a pose, its velocities and, of ContactNets' tosses, six more
_WIDTHS = (3, 6, 7, 12, 16, *_STATES)  # a position, with three angles, with a quaternion, matrices, states
_FOLLOWS = 0.9  # correlation of a velocity with the steps of its position


def find_unnamed(table: Table, arrays: dict[str, np.ndarray]) -> list[FoundTrack]:
    """A pose in columns without names, or in one array of all that was recorded.

    A time, a count or nothing, then TUM's seven numbers (or the quaternion first), KITTI's twelve, a matrix
    of sixteen by rows or columns, a position and three angles, or a pose with its velocities behind it. What
    stands before them increases: a motor's input, time, speed and angle are no time and position. Of an array
    a position and four numbers of length 1 are a pose, whatever follows them.

    Args:
        table: of the log.
        arrays: its columns of numbers.
    """
    if len(arrays) == 1 and (one := next(iter(arrays.values()))).ndim == 2:
        return _find_in_array(next(iter(arrays)), one)
    names = [name for name in arrays if name.isdecimal() and arrays[name].ndim == 1]
    if len(names) != len(arrays) or len(names) < min(_WIDTHS):
        return []
    numbers = np.column_stack([arrays[name] for name in names])
    numbers = numbers[np.isfinite(numbers).all(axis=1)]
    if len(numbers) < LEAST:
        return []
    for first in (0, 1):
        parts = [Component(name) for name in names[first:]]
        columns = _pose_of(parts, numbers[:, first:]) if len(parts) in _WIDTHS else {}
        vague = len(parts) in (3, 6)  # any numbers: what stands before them must be a time or a count
        timed = not first or bool((np.diff(numbers[:, 0]) >= 0).all() and np.ptp(numbers[:, 0]))
        whole = len(parts) > 3 or len(names) == len(table.columns)  # cells of text are beside no track
        if columns and whole and (timed or not vague):
            return [FoundTrack((), columns, named=False, vague="rotation_vector" in columns)]
    return []


def _pose_of(parts: list[Component], numbers: np.ndarray) -> dict[str, list[Component]]:
    """Columns of a pose in so many numbers (N, K); empty where they are none."""
    width = numbers.shape[1]
    if width in (12, 16):
        listed = matrix_parts(parts, numbers)
        return {"matrix": listed} if listed else {}
    if width in _STATES:
        moves = np.diff(numbers[:, :3], axis=0).ravel(), (numbers[1:, 7:10] + numbers[:-1, 7:10]).ravel()
        told = all(np.ptp(each) for each in moves) and np.corrcoef(*moves)[0, 1] > _FOLLOWS
        return _pose_of(parts[:7], numbers[:, :7]) if told and _are_quaternions(numbers[:, 3:7]) else {}
    if width == 7:
        if _are_quaternions(numbers[:, 3:]):
            return {"position": parts[:3], "quaternion": parts[3:]}
        return {"position": parts[4:], "quaternion": parts[:4]} if _are_quaternions(numbers[:, :4]) else {}
    if width == 6:
        return {"position": parts[:3], "rotation_vector": parts[3:]}
    return {"position": parts} if width == 3 else {}


def _find_in_array(name: str, numbers: np.ndarray) -> list[FoundTrack]:
    """A pose in the columns (N, K) of an array: three numbers and four of length 1."""
    seen = np.isfinite(numbers).all(axis=1)
    if seen.sum() < LEAST:
        return []
    for first in (0, 1):  # a time before it
        if numbers.shape[1] >= first + 7 and _are_quaternions(numbers[seen, first + 3 : first + 7]):
            parts = [Component(name, k) for k in range(first, first + 7)]
            return [FoundTrack((), {"position": parts[:3], "quaternion": parts[3:]}, named=False)]
    return []


def _are_quaternions(numbers: np.ndarray) -> bool:
    """Whether rows (N, 4) have length 1."""
    return float(np.abs(np.linalg.norm(numbers, axis=1) - 1.0).max()) < _UNIT_LENGTH


def are_mostly_quaternions(numbers: np.ndarray) -> bool:
    """Whether most rows (N, 4) that say something have length 1: lost frames are empty, or zeros."""
    length = np.linalg.norm(numbers, axis=1)
    length = length[np.isfinite(length) & (length > 0.0)]
    return bool(len(length)) and float(np.median(np.abs(length - 1.0))) < _UNIT_LENGTH
