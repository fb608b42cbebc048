"""The same points in two frames, a file each: they have no orientation, and are no motions of a body."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from samrl_core.common.errors import InputError
from samrl_ros.log_import.draft.tracks.logged_tracks import LoggedTrack
from samrl_ros.log_import.draft.tracks.track_entries import find_time

LEAST_POINTS = 6
SAME = 0.05  # of their spread, that a turn and a shift leave of points that are the same
FLAT = 0.01  # of the widest spread, below which points lie on a line, which fits any other


def refuse_point_pairs(tracks: Sequence[LoggedTrack]) -> None:
    """Say what a chain needs beside pairs of points.

    Raises:
        InputError: two files of positions without a time, of which a turn and a shift take one to the other.
    """
    if len(tracks) != 2 or len({each.path for each in tracks}) != 2:
        return
    if any(each.track.whole or each.track.axes != "xyz" for each in tracks):
        return
    if any(find_time(each, each.track.used) is not None for each in tracks):
        return
    first, second = (each.position for each in tracks)
    if len(first) != len(second) or len(first) < LEAST_POINTS:
        return
    rest = _rest_of_fit(first, second)
    if rest is None or rest > SAME:
        return
    names = " and ".join(each.path.name for each in tracks)
    raise InputError(
        f"{names}: the same {len(first)} points in two frames, as a turn and a shift take one file to the"
        f" other within {100 * rest:.1f} % of their spread. Points have no orientation: a chain needs the"
        " target's pose in the camera (rvec_x, ..., tvec_z of cv2.solvePnP) beside the flange's (x, y, z and"
        " a rotation), a row or a file for each view"
    )


def _rest_of_fit(first: np.ndarray, second: np.ndarray) -> float | None:
    """What the best turn and shift of the second (N, 3) leave of the first, by its spread; None of a line."""
    keep = np.isfinite(first).all(axis=1) & np.isfinite(second).all(axis=1)
    a, b = first[keep] - first[keep].mean(axis=0), second[keep] - second[keep].mean(axis=0)
    if len(a) < LEAST_POINTS:
        return None
    widths = np.linalg.svd(a, compute_uv=False)
    if widths[1] < FLAT * widths[0]:
        return None
    _, left = Rotation.align_vectors(a, b)
    return float(left / np.linalg.norm(a))
