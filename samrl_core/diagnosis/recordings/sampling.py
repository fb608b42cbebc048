"""Is a recording long enough, finite, even in time, and do its channels overlap?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.recordings.motion_check import typical_step

QUANTITIES = ("position", "velocity", "acceleration", "effort")
LEAST_SAMPLES = 200  # of a channel; ASSUMPTION: about ten samples per parameter and joint
LEAST_DURATION_S = 1.0
SPARSE_S = 0.05  # typical step from which on a channel is setpoints, not a stream
LONGEST_GAP_S = 0.2
RATE_CHANGE = 2.0  # ratio of the largest to the smallest local rate
RATE_RANGE_HZ = (5.0, 20_000.0)  # outside, the unit of time is suspected


def channels(recording: ArmRecording) -> Iterator[tuple[str, JointSignal]]:
    """Name and signal of every channel that was recorded."""
    for name in ("states", "command", "commanded_effort"):
        signal = getattr(recording, name)
        if signal is not None:
            yield name, signal


def check_finite(where: str, channel: str, signal: JointSignal, joints: tuple[str, ...]) -> None:
    """Raises `InputError` naming channel, joint and span of the first run that is NaN or infinite."""
    for quantity in QUANTITIES:
        values = getattr(signal, quantity)
        if values is None:
            continue
        bad = ~np.isfinite(values)
        if not bad.any():
            continue
        column = int(np.flatnonzero(bad.any(axis=0))[0])
        rows = np.flatnonzero(bad[:, column])
        ends = np.flatnonzero(np.diff(rows) > 1)
        last = rows[ends[0]] if len(ends) else rows[-1]
        raise InputError(
            f"{where}: {channel} {quantity} of {joints[column]} is not finite from {signal.time[rows[0]]:.4f}"
            f" to {signal.time[last]:.4f} s ({bad.sum()} numbers in {len(ends) + 1} runs of this joint, and"
            f" {int(bad.any(axis=0).sum()) - 1} more joints); cut the recording there, or leave the quantity"
            " out: missing values are not filled in"
        )


def check_length(where: str, channel: str, signal: JointSignal) -> None:
    """Raises `InputError` for fewer than 200 samples or less than a second."""
    count = len(signal)
    duration = float(signal.time[-1] - signal.time[0]) if count else 0.0
    if count < LEAST_SAMPLES or duration < LEAST_DURATION_S:
        raise InputError(
            f"{where}: {channel} has {count} samples over {duration:.3f} s; needed are {LEAST_SAMPLES}"
            f" samples and {LEAST_DURATION_S} s: record longer, or at a higher rate"
        )


def check_increasing(where: str, channel: str, signal: JointSignal) -> None:
    """Raises `InputError` where time does not increase."""
    bad = np.flatnonzero(~(np.diff(signal.time) > 0))
    if len(bad):
        k = int(bad[0])
        raise InputError(
            f"{where}: time of {channel} goes from {signal.time[k]:.6f} to {signal.time[k + 1]:.6f} s at"
            f" sample {k + 1} ({len(bad)} such steps); stamps must increase: cut the recording there"
        )


def longest_step(signal: JointSignal) -> float:
    """Time between samples [s] from which on something is missing."""
    return max(LONGEST_GAP_S, 5.0 * typical_step(signal.time))


def rate_notes(channel: str, signal: JointSignal) -> list[str]:
    """Rates out of the ordinary, gaps, and a rate that changes within the recording."""
    steps = np.diff(signal.time)
    typical = typical_step(signal.time)
    notes = []
    if not RATE_RANGE_HZ[0] <= 1.0 / typical <= RATE_RANGE_HZ[1]:
        notes.append(
            f"{channel} comes at {1.0 / typical:.4g} Hz over {signal.time[-1] - signal.time[0]:.4g} s; is the"
            " time in seconds?"
        )
    longest = longest_step(signal)
    gaps = np.flatnonzero(steps > longest)
    if len(gaps):
        worst = int(gaps[np.argmax(steps[gaps])])
        notes.append(
            f"{channel} has {len(gaps)} gaps above {longest:.3g} s, the longest {steps[worst]:.3f} s from"
            f" {signal.time[worst]:.3f} s; nothing is known of what happened there"
        )
    size = max(20, len(steps) // 20)
    starts = np.arange(0, len(steps) - size + 1, size)
    local = np.array([typical_step(signal.time[k : k + size + 1]) for k in starts])
    if local.max() > RATE_CHANGE * local.min():
        slow, fast = int(starts[local.argmax()]), int(starts[local.argmin()])
        notes.append(
            f"{channel} changes its rate: {1 / local.max():.4g} Hz around {signal.time[slow]:.2f} s,"
            f" {1 / local.min():.4g} Hz around {signal.time[fast]:.2f} s"
        )
    return notes


def overlap_notes(where: str, recording: ArmRecording) -> list[str]:
    """Notes on channels that cover the states only in part. Raises `InputError` if one does not at all."""
    begin, end = recording.states.time[0], recording.states.time[-1]
    notes = []
    for channel, signal in channels(recording):
        shared = min(end, signal.time[-1]) - max(begin, signal.time[0])
        if shared <= 0:
            raise InputError(
                f"{where}: {channel} lies at {signal.time[0]:.3f} to {signal.time[-1]:.3f} s, the states at"
                f" {begin:.3f} to {end:.3f} s; they share no time. Stamp both with the same clock"
            )
        if shared < 0.9 * (end - begin):
            notes.append(f"{channel} covers only {shared:.2f} of {end - begin:.2f} s of the states")
    return notes
