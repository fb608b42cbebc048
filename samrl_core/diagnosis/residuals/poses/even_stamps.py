"""Stamps of a device of an even rate, of which a log kept too few digits.

Rounded to 10 ms, 33 Hz give a saw of +-5 ms that lasts a second: no noise, as neighbours share it, and at
4 rad/s 20 mrad. The line through the stamps has none of it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from samrl_core.cell.types.pose_recording import ArmPoses, PoseRecording, PoseTrack
from samrl_core.diagnosis.residuals.poses.noise import rounding

LEAST = 60  # stamps that tell a rate
WORSE = 1.15  # times the rounding, that an even rate may leave: a device's own scatter beside it
COVERED = 0.1  # of the decimal, that its errors may leave out; else it is not known where within it they lie


def even_stamps(stamps: np.ndarray) -> np.ndarray:
    """Stamps (N,) [s] of an even rate, where that and their rounding is all there is; else as they are.

    Poses may be lost. Where rate and decimal agree, as 50 Hz and 10 ms, the errors are a few numbers, and
    what was rounded off all of them stays unknown.
    """
    scatter = rounding(stamps)
    if not scatter or len(stamps) < LEAST:
        return stamps
    decimal, steps = scatter * np.sqrt(12.0), np.diff(stamps)
    single = steps[np.abs(steps - np.median(steps)) < 1.5 * decimal]
    count = np.concatenate([[0.0], np.cumsum(np.maximum(np.round(steps / np.mean(single)), 1.0))])
    line = np.polyval(np.polyfit(count, stamps - stamps[0], 1), count) + stamps[0]
    left = stamps - line
    inside = np.sort(left[np.abs(left) < 0.5 * decimal])
    gaps = np.diff(np.concatenate([[-0.5 * decimal], inside, [0.5 * decimal]]))
    if np.std(left) > WORSE * scatter or np.max(gaps) > COVERED * decimal:
        return stamps
    return line


def with_even_stamps(recording: PoseRecording) -> tuple[PoseRecording, str]:
    """The recording with even stamps where it has any, and a note of it; else as it is, and nothing."""
    if not recording.timed:
        return recording, ""
    named = []

    def even(name: str, time: np.ndarray) -> np.ndarray:
        found = even_stamps(time)
        if found is not time:
            named.append(f"{name} ({1.0 / np.median(np.diff(found)):.4g} Hz)")
        return found

    def track(name: str, one: PoseTrack) -> PoseTrack:
        return replace(one, time=even(name, one.time))

    def arm(one: ArmPoses) -> ArmPoses:
        if one.flange is not None:
            return replace(one, flange=track(one.role, one.flange))
        return replace(one, joint_time=even(one.role, one.joint_time))

    arms = {a.role: arm(a) for a in recording.arms}
    seen = track(recording.target, recording.seen)
    if not named:
        return recording, ""
    made = replace(recording, seen=seen, **arms)
    return (
        made,
        f"{recording.name}: stamps of {', '.join(named)} were rounded; those of its even rate are taken",
    )
