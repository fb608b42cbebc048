"""Arm recordings before the diagnosis: fit to be diagnosed, units plausible, held-out data unseen."""

from samrl_core.diagnosis.recordings.check import check_recording
from samrl_core.diagnosis.recordings.held_out import block, check_held_out, split
from samrl_core.diagnosis.recordings.motion_check import no_motion, still_joints
from samrl_core.diagnosis.recordings.whole import longest_whole

__all__ = [
    "block",
    "check_held_out",
    "check_recording",
    "longest_whole",
    "no_motion",
    "split",
    "still_joints",
]
