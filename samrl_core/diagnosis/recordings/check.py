"""One door: can this recording be diagnosed, and what is odd about it?"""

from __future__ import annotations

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.recordings import gravity_torque, sampling, units
from samrl_core.diagnosis.recordings import motion_check as motion


def check_recording(recording: ArmRecording) -> tuple[str, ...]:
    """Notes worth showing the user: suspicions, gaps, joints at rest.

    Raises:
        InputError: too short, not finite, time not increasing, channels without common time, no motion at
            all, or units that are wrong beyond doubt; value, limit and remedy are named.
    """
    where = f"{recording.name} ({recording.arm.role})"
    joints = recording.arm.joints
    notes: list[str] = []
    for channel, signal in sampling.channels(recording):
        shapes = [getattr(signal, q) for q in sampling.QUANTITIES]
        for values in shapes:
            if values is not None and values.shape != (len(signal), len(joints)):
                raise InputError(
                    f"{where}: {channel} has shape {values.shape}, must be {(len(signal), len(joints))}"
                )
        sampling.check_length(where, channel, signal)
        sampling.check_increasing(where, channel, signal)
        sampling.check_finite(where, channel, signal, joints)
        notes += sampling.rate_notes(channel, signal)
    if recording.states.position is None:
        raise InputError(f"{where}: the states carry no position; nothing can be said without it")
    notes += sampling.overlap_notes(where, recording)
    if reason := motion.no_motion(recording):
        raise InputError(f"{where}: {reason}")
    if still := motion.still_joints(recording):
        notes.append(f"{', '.join(still)} do not move (range below {motion.LEAST_RANGE} rad or m)")
    units.refuse_wraps(where, recording)
    notes += units.limit_notes(where, recording)
    notes += units.velocity_notes(where, recording)
    notes += units.command_notes(where, recording)
    notes += units.effort_notes(recording)
    notes += gravity_torque.gravity_notes(where, recording)
    return tuple(notes)
