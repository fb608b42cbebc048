"""Names of columns that stand in another order than the columns: a time goes back, a place runs on evenly."""

from __future__ import annotations

import numpy as np

from samrl_ros.log_import.draft.blocks import numbers_of
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.tracks.logged_tracks import LoggedTrack
from samrl_ros.log_import.draft.tracks.pose_tracks import time_columns

EVEN = 0.1  # of a step, by which steps of a clock differ that was rounded


def ask_of_name_order(each: LoggedTrack, draft: Draft) -> None:
    """Ask whether names fit their columns where the one called time goes back and a place goes on evenly."""
    named = time_columns(each.table, each.track.used)
    even = [name for name in each.track.used if _goes_on_evenly(numbers_of(each.table, name))]
    if named and even:
        draft.note(
            "bodies.track.position",
            f"{named[0]!r} is named as time and goes back, {even[0]!r} goes on evenly",
            "do the names stand in the order of the columns? Else list them rightly in the source,"
            " `csv: {header: [...], skip_lines: 1}`, and name the time there",
        )  # fmt: skip


def _goes_on_evenly(values: np.ndarray | None) -> bool:
    if values is None or values.ndim != 1 or not np.isfinite(values).all():
        return False
    steps = np.diff(values)
    return bool((steps > 0).all() and np.ptp(steps) < EVEN * float(np.median(steps)))
