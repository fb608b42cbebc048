"""A command on a recording's clock, as its controller follows it: on time or late, in a line or held.

What comes late comes late by its own stamps. Where a log lacks rows, others stand for them on the clock's
grid, and shifted along it those would be late by as much more or less as the rows are apart: noise of the
law that grows with the speed. Held goals are stairs; shifted along samples they would be ramps, and every
delay within one a mixture of two goals that no drive ever had.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from samrl_core.cell.types.arm_description import ArmController
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.residuals.signals.sample_times import SampleTimes, regular
from samrl_core.diagnosis.residuals.signals.signal_band import (
    SAME_INSTANT,
    held_on_grid,
    onto_grid,
    read_times,
)


class Clocked(Protocol):
    """A recording on one clock."""

    recording: ArmRecording
    time: np.ndarray  # (F,) [s]
    raw_position: np.ndarray | None  # (F, J)
    taken: SampleTimes  # of the states

    @property
    def controller(self) -> ArmController | None:
        """As described."""

    @property
    def holds_commands(self) -> bool:
        """Whether it keeps each command until the next one."""

    def times_of(self, time: np.ndarray, values: np.ndarray) -> SampleTimes:
        """When the samples of a channel were taken."""


def track_command(motion: Clocked, command: JointSignal, late: float) -> JointSignal | None:
    """A command on the full-rate grid, `late` [s] after its stamps; what it lacks is zero.

    None of a command without positions, but of a loop that needs none.
    """
    position, velocity, effort = (
        _track(motion, command.time, x, late) for x in (command.position, command.velocity, command.effort)
    )
    zero = np.zeros_like(motion.raw_position)
    if position is None:
        controller = motion.controller
        if command.velocity is None or controller is None or np.any(controller.stiffness > 0):
            return None
        position = zero  # a speed loop is told no position
    velocity, effort = (zero if x is None else x for x in (velocity, effort))
    return JointSignal(motion.time, position, velocity, None, effort)


def find_delays_alike(motion: Clocked, command: JointSignal, late: float) -> tuple[float, float]:
    """Delays [s] of a command, from and to, at which every row holds the same goal as at this one.

    Where goals are held and a row tells the torque of its instant, that is most of a goal's time: with one
    row a goal, nothing tells a delay of 11 ms from one of 19. Elsewhere each delay gives other torques.
    """
    if not motion.holds_commands or _averages_goals(motion):
        return late, late
    step = float(motion.time[1] - motion.time[0])
    come, rows = regular(command.time) + late, motion.time + SAME_INSTANT * step
    held = np.searchsorted(come, rows, side="right") - 1
    has, waits = held > 0, held < len(come) - 1  # what came before its first goal nobody knows
    more = float(np.min(rows[has] - come[held[has]], initial=step))
    less = float(np.min(come[held[waits] + 1] - rows[waits], initial=step))
    return max(late - less, 0.0), late + more


def _track(motion: Clocked, time: np.ndarray, values: np.ndarray | None, late: float) -> np.ndarray | None:
    """A command's part (F, J) between two stamps."""
    if values is None:
        return None
    if motion.holds_commands:
        return held_on_grid(time + late, values, motion.time, _averages_goals(motion))
    given = motion.times_of(time, values)
    if late == 0.0:
        return onto_grid(given, values, motion.time)
    at = read_times(motion.taken, motion.time) - late
    return np.stack([np.interp(at, given.time, column) for column in values.T], axis=1)


def _averages_goals(motion: Clocked) -> bool:
    """Whether held goals count as their mean over a sample; beside a recorded torque as at its instant."""
    states = motion.recording.states
    return motion.recording.commanded_effort is None and states.effort is None
