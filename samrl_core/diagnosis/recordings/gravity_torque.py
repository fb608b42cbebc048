"""Measured effort at slow motion against the gravity torque of the URDF: wrong unit, sign or model?"""

from __future__ import annotations

import numpy as np

from samrl_core.cell.robots.joint_dynamics import joint_dynamics
from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.recordings.motion_check import derivative
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm

_SAMPLES = 300
_SLOW_SHARE = 0.4  # of the samples, those with the least speed
_LEAST_TORQUE = 0.05  # [N m or N] rms; an arm without gravity (a slide, a vertical axis) says nothing
_MOST_INERTIAL = 0.4  # torque of accelerations against gravity's, rms; above, slow motion is not still
_CERTAIN = 0.9  # correlation
_UNRELATED = 0.3
_THOUSAND = (300.0, 3000.0)  # a factor of 1000 with any gain that a drive may have


def gravity_notes(where: str, recording: ArmRecording) -> list[str]:
    """Suspicions about the effort.

    Raises:
        InputError: the effort follows gravity but for a factor of about a thousand, or a broken URDF.
    """
    if recording.arm.urdf is None or recording.states.position is None:
        return []
    q, time = recording.states.position, recording.states.time
    source = "effort of the states"
    effort = recording.states.effort
    if effort is None and recording.commanded_effort is not None:
        source, channel = "commanded effort", recording.commanded_effort
        assert channel.effort is not None  # the only thing this channel carries
        effort = np.column_stack([np.interp(time, channel.time, e) for e in channel.effort.T])
    if effort is None:
        return []
    velocity = derivative(time, q)
    speed = np.abs(velocity).max(axis=1)
    slow = np.sort(np.argsort(speed, kind="stable")[: max(1, int(_SLOW_SHARE * len(q)))])
    slow = slow[:: max(1, len(slow) // _SAMPLES)]
    rigid = RigidArm(recording.arm)
    gravity = rigid.gravity(q[slow])
    measured = effort[slow]
    size = np.sqrt((gravity**2).mean())
    if size < _LEAST_TORQUE or not measured.any():
        return []
    acceleration = derivative(time, velocity)
    moving = rigid.inverse_dynamics(q[slow], velocity[slow], acceleration[slow]) - gravity
    moving = moving + joint_dynamics(recording.arm).armature * acceleration[slow]
    if np.sqrt((moving**2).mean()) > _MOST_INERTIAL * size:
        return []  # where an arm that swings is slow, it turns back: its accelerations hide gravity
    product = float((measured * gravity).sum())
    likeness = product / np.sqrt(float((measured**2).sum()) * float((gravity**2).sum()))
    ratio = product / float((gravity**2).sum())
    said = (
        f"the {source} at slow motion is {ratio:.3g} times the gravity torque of the URDF (rms {size:.3g}"
        f" N m, correlation {likeness:.2f})"
    )
    if likeness > _CERTAIN:
        for low, high, meaning in (
            (*_THOUSAND, "in mN m"),
            (1 / _THOUSAND[1], 1 / _THOUSAND[0], "in kN m, or the URDF's masses are in grams"),
        ):
            if low < ratio < high:
                raise InputError(f"{where}: {said}: it is {meaning}; convert to N m and kg")
        if not 0.5 < ratio < 2.0:
            return [f"suspected: {said}; motor side without gear ratio, current for torque, or wrong URDF?"]
        return []
    if likeness < -_CERTAIN:
        return [f"suspected: {said}; the sign of the effort is turned around"]
    if likeness < _UNRELATED:
        return [f"suspected: {said}; wrong URDF, zero position, mounting or joint order?"]
    return []
