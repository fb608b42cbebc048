"""Heights over time in which no fall is found because they scatter, or were sampled too seldom."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.common.errors import InputError
from samrl_ros.log_import.draft.blocks import LEAST_ROWS
from samrl_ros.log_import.draft.bodies.free_fall import CLEAR, FALLS_S, LEAST_SAMPLES, WINDOWS_S, G
from samrl_ros.log_import.draft.bodies.seen_tracks import is_of_a_machine, look_at
from samrl_ros.log_import.draft.column_names import words_in
from samrl_ros.log_import.draft.tracks.logged_tracks import LoggedTrack
from samrl_ros.log_import.draft.tracks.pose_tracks import HEIGHTS
from samrl_ros.log_import.draft.tracks.track_entries import SECONDS
from samrl_ros.log_import.pose_specs import LENGTHS

_LONGEST_S = WINDOWS_S[-1]
_LEAST_HZ = LEAST_SAMPLES / (2.0 * _LONGEST_S)
_MAD = 1.4826  # standard deviations of a median absolute deviation, of normal noise
_VIDEO_HZ = 60.0


def refuse_unclear_height(tracks: Sequence[LoggedTrack]) -> None:
    """Say what hides a fall in a height, where something does.

    Raises:
        InputError: a height alone that scatters by more than a fall allows, or is too short for a joint.
    """
    looks = [look_at(each) for each in tracks]
    for seen in looks:
        named = set(words_in(seen.each.track.names)) & HEIGHTS and len(seen.each.track.axes) == 1
        if not named or seen.fall or seen.curve or is_of_a_machine(seen.each, tracks):
            return
    for seen in looks:
        each, height = seen.each, seen.each.position[:, 0]
        if seen.time is None or np.isfinite(height).sum() < LEAST_SAMPLES:
            continue
        open_unit = not seen.time.proof and seen.time.entry
        seconds = 1.0 if open_unit else SECONDS[seen.time.units[0]]
        step = seconds * float(np.nanmedian(np.diff(seen.time.values)))
        noise = LENGTHS.get(each.track.unit, 1.0) * _measure_scatter(height)
        if not step > 0.0 or (len(height) >= LEAST_ROWS and noise < find_clear_noise(1.0 / step)):
            continue
        units = "s and m" if open_unit else "m"
        limit = find_clear_noise(_VIDEO_HZ)
        raise InputError(
            f"{each.name}: a height of {len(height)} samples, {1.0 / step:.3g} a second, scatters by"
            f" {noise:.2g} m from one to the next (if in {units}), and no fall is found in it. One of"
            f" {FALLS_S[0]:g} to {FALLS_S[1]:g} s is found from {_LEAST_HZ:g} samples a second on, and at"
            f" {_VIDEO_HZ:g} a second with a scatter below {limit:.2g} m. Film it with a scale in the picture"
            " and track it (t,x,y); GPS and barometers scatter by metres"
        )


def find_clear_noise(rate_hz: float) -> float:
    """Scatter of positions [m] up to which a fall's acceleration shows in the longest window.

    A parabola over N samples in T has an acceleration with noise sigma sqrt(720 / N) / T^2 (least squares).
    """
    count = max(rate_hz * _LONGEST_S, LEAST_SAMPLES)
    return CLEAR * G * _LONGEST_S**2 / float(np.sqrt(720.0 / count))


def _measure_scatter(values: np.ndarray) -> float:
    """Standard deviation of what is not smooth in values (N,), by their second differences."""
    bends = np.diff(values[np.isfinite(values)], n=2)
    return _MAD * float(np.median(np.abs(bends - np.median(bends)))) / float(np.sqrt(6.0))
