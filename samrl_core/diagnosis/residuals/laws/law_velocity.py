"""Which velocity a law damps where the logged one is late: that one, or the positions' derivative.

A drive may run its loop on what it reports, or on a faster reading that nobody logs. Both are known signals,
so nothing is fitted for them: the law is read with each, and what it leaves of the recorded torque decides,
or of the torque that the motion takes where none was recorded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.diagnosis.residuals.equations import drive_channel, form_equations
from samrl_core.diagnosis.residuals.laws.late_law import explained_log_likelihood, late_law_change
from samrl_core.diagnosis.residuals.motion import RecordedMotion
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm

TINY = 1e-9  # of a spring's torque: no log of numbers tells less


def with_law_velocity(recordings: Sequence[ArmRecording], lag_s: float) -> tuple[list[ArmRecording], str]:
    """Recordings whose law damps what their torque says that it damps, and what was found.

    Args:
        recordings: of one arm, with filtered velocities.
        lag_s: of the driver's filter [s], which the law gets where it damps the filtered velocity.
    """
    by_derivative = [replace(r, states=replace(r.states, filtered_velocity=None)) for r in recordings]
    pairs = [
        (_explained(logged), _explained(derived))
        for logged, derived in zip(recordings, by_derivative, strict=True)
    ]
    evidence = [a.log_likelihood - b.log_likelihood for a, b in pairs if a is not None and b is not None]
    if not evidence:
        return by_derivative, ""
    what = next(a.what for a, _ in pairs if a is not None)
    if sum(evidence) <= 0.0:
        return by_derivative, f"; so does the law, which explains the {what} better so"
    found = [replace(r, arm=_damping_late(r.arm, lag_s)) for r in recordings]
    return found, f"; the law damps the logged one, which explains the {what} better"


def _damping_late(arm: ArmDescription, lag_s: float) -> ArmDescription:
    assert arm.controller is not None
    law = replace(arm.controller.law, velocity_lag=lag_s)
    return replace(arm, controller=replace(arm.controller, law=law))


@dataclass(frozen=True)
class _Explained:
    """How well a law explains a recording."""

    log_likelihood: float
    what: str  # of it is explained


def _explained(recording: ArmRecording) -> _Explained | None:
    """What a law makes of a recorded torque, or of the torque that the motion takes; None without either.

    Other gains, an offset, a slow integral, a late command: their torque is taken off, so that none of them
    passes for a filter. The noise of each joint is what is then left (profile likelihood).
    """
    controller = recording.arm.controller
    if controller is None or controller.law.open_loop or not np.any(controller.damping > 0):
        return None
    rigid = None if recording.arm.urdf is None else RigidArm(recording.arm)
    motion = RecordedMotion(recording, rigid)
    command = motion.command
    if command is None or command.position is None:
        return None
    if motion.computed:
        residual = form_equations(motion).residual
        left, what = residual[drive_channel(residual)], "motion"
    elif motion.asked is not None:
        limit = motion.limit()
        off = np.clip(motion.described_law.total, -limit, limit) - motion.asked
        left, what = motion.reduce(motion.enabled * off), "recorded torque"
    else:
        return None
    law, step = motion.described_law, 1.0 / motion.rate
    otherwise = [motion.reduce(x) for x in (law.spring, law.damper, late_law_change(motion, step))]
    slow = np.linspace(-1.0, 1.0, len(left))
    total = 0.0
    for j in range(motion.joints):
        columns = [np.ones_like(slow), slow, *(x[:, j] for x in otherwise)]
        least = TINY * max(float(np.std(otherwise[0][:, j])), TINY)
        total += explained_log_likelihood(left[:, j], columns, least)
    return _Explained(total, what)
