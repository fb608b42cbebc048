"""Efforts, speeds and travel that are typical of an arm, over its recordings together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from samrl_core.diagnosis.residuals.equations import scale_limits, scale_speeds
from samrl_core.diagnosis.residuals.motion import RecordedMotion


@dataclass(frozen=True, eq=False)
class ArmRanges:
    """Of each joint, (J,), and of their driver."""

    effort: np.ndarray  # [N m] limit, or the largest that was seen where none is stated
    speed: np.ndarray  # [rad/s] likewise, 1 at least where none is stated
    fastest: np.ndarray  # [rad/s] that a hundredth of the samples exceed, where it is highest
    strongest: np.ndarray  # [N m] commanded; 1 where none is known
    travel: np.ndarray  # [rad] over which it was seen
    effort_lag: float  # [s] of the joints' torque sensors behind a driver's filter; 0 where none shows
    torque_lag: float  # [s] the same of the torque that the drives report


def find_ranges(motions: Sequence[RecordedMotion]) -> ArmRanges:
    """Of all recordings together, whatever their order."""
    ones = np.ones(motions[0].joints)
    speeds = [ones if m.arm is None else scale_speeds(m.arm, m) for m in motions]
    efforts = [ones if m.u is None else np.max(np.abs(m.u), axis=0) for m in motions]
    lowest, highest = (np.array([end(m.q, axis=0) for m in motions]) for end in (np.min, np.max))
    return ArmRanges(
        effort=np.max([scale_limits(m.recording.arm, m.arm, m) for m in motions], axis=0),
        speed=np.max(speeds, axis=0),
        fastest=np.max([np.quantile(np.abs(m.sure_velocity), 0.99, axis=0) for m in motions], axis=0),
        strongest=np.max(efforts, axis=0),
        travel=np.max(highest, axis=0) - np.min(lowest, axis=0),
        effort_lag=float(np.median([m.noise.effort_filter.lag_s for m in motions])),
        torque_lag=float(np.median([m.noise.torque_filter.lag_s for m in motions])),
    )
