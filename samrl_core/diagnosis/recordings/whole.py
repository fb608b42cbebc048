"""The part of a recording in which nothing is missing."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.diagnosis.recordings import sampling
from samrl_core.diagnosis.recordings.held_out import block


def longest_whole(recording: ArmRecording) -> tuple[ArmRecording, str]:
    """The longest span in which all channels are there without a gap, and a note if that is not all.

    Between two episodes the arm is placed anew, and before the first command and after the last nobody knows
    what the controller tracked: what was not recorded must not be made up. Channels that are sparse by
    nature (a setpoint now and then) do not cut.
    """
    first, last = float(recording.states.time[0]), float(recording.states.time[-1])
    begin, end, cuts = first, last, []
    for _, signal in sampling.channels(recording):
        if len(signal) < 2 or float(np.median(np.diff(signal.time))) > sampling.SPARSE_S:
            continue
        begin, end = max(begin, float(signal.time[0])), min(end, float(signal.time[-1]))
        steps = np.diff(signal.time)
        for k in np.flatnonzero(steps > sampling.longest_step(signal)):
            cuts.append((float(signal.time[k]), float(signal.time[k + 1])))
    spans, start = [], begin
    for stop, resume in sorted(cuts):
        if start < stop <= end:
            spans.append((start, stop))
        start = max(start, resume)
    if start < end:
        spans.append((start, end))
    if not spans:
        return recording, ""
    a, b = max(spans, key=lambda s: s[1] - s[0])
    if b - a > 0.999 * (last - first):
        return recording, ""
    note = (
        f"the longest part without a gap is used, {a:.2f} to {b:.2f} s of {first:.2f} to {last:.2f} s"
        f" ({len(spans)} such parts)"
    )
    return block(recording, a, np.nextafter(b, np.inf)), note
