"""One recording of one arm: what was commanded and what was measured, in time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.types.arm_description import ArmDescription


@dataclass(frozen=True, eq=False)
class JointSignal:
    """Samples of a joint-space channel at strictly increasing stamps."""

    time: np.ndarray  # (N,) [s], seconds since the recording's own start
    position: np.ndarray | None = None  # (N, J) [rad or m]
    velocity: np.ndarray | None = None  # (N, J) [rad/s or m/s]
    acceleration: np.ndarray | None = None  # (N, J) [rad/s2 or m/s2]
    effort: np.ndarray | None = None  # (N, J) [N m or N]
    # (N, J) [rad/s or m/s] as a driver's low-pass reports it, where a law damps that and it is no motion's
    filtered_velocity: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.time)


@dataclass(frozen=True, eq=False)
class ArmRecording:
    """A recording. Channels that were not recorded are None, and so are their quantities.

    All channels share one time axis and the joint order of `arm.joints`.
    """

    name: str  # as shown to the user, usually the bag's file name
    source: str  # path it was read from
    sha256: str  # of the file
    arm: ArmDescription
    states: JointSignal  # position, velocity, effort = link-side torque-sensor reading, gravity included
    command: JointSignal | None  # what the controller tracks; effort = feed-forward without gravity
    commanded_effort: JointSignal | None  # effort only: torque sent to the drives, gravity included
    phases: tuple[tuple[float, str], ...] = ()  # (time [s], mark) as published by the controller
    torque_enabled: JointSignal | None = None  # effort: 1 on, 0 off; the last one holds

    @property
    def duration(self) -> float:
        """Length [s]."""
        return float(self.states.time[-1] - self.states.time[0])
