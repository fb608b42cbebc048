"""A commanded speed that a law uses and a log lacks: it is that of the goals."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np

from samrl_core.cell.types.arm_description import HELD, ArmController
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.cell.types.controllers import KINDS
from samrl_core.diagnosis.residuals.signals.sample_times import SampleTimes
from samrl_core.diagnosis.residuals.signals.slopes import find_slopes

SHARE = "velocity_feedforward"  # key of kinds that may feed the commanded velocity forward
CLEARLY = 0.25  # of the recorded torque's power that the other law leaves unexplained
LATE_S = tuple(0.005 * k for k in range(11))  # delays of the command at which each law is tried


class Tracked(Protocol):
    """A recording on one clock, whose law can be evaluated with another command."""

    recording: ArmRecording

    @property
    def asked(self) -> np.ndarray | None:
        """Torque (F, J) that was asked for, as recorded."""

    def left_by_law(self, command: JointSignal, late: float) -> np.ndarray | None:
        """Torque (F, J) that the described law gives with a command so late [s] beyond what was asked for."""

    def times_of(self, time: np.ndarray, values: np.ndarray) -> SampleTimes:
        """When samples were taken."""


def is_goals_own(motion: Tracked) -> bool:
    """Whether the speed that a law uses beside positions alone is their derivative."""
    return infers_speed(motion.recording) or damps_against_goals(motion)


def infers_speed(recording: ArmRecording) -> bool:
    """Whether a law feeds a commanded speed forward that the log lacks: it is that of its goals.

    Goals that are held until the next one have none. The share is the stated one, else its kind's default,
    which is 1 of a velocity drive; a kind without such a share feeds none.
    """
    controller = recording.arm.controller
    if controller is None or not _lacks_speed(recording):
        return False
    share = controller.law.of_joints("velocity_share", len(controller.joints))
    return _has_share(controller) and bool(np.any(share > 0.0))


def _may_damp_against_goals(recording: ArmRecording) -> bool:
    """Whether a law whose kind states no share may feed such a speed, and a recorded torque may tell."""
    controller = recording.arm.controller
    sent = recording.commanded_effort
    if controller is None or sent is None or sent.effort is None or controller.law.open_loop:
        return False
    return _lacks_speed(recording) and not _has_share(controller) and bool(np.any(controller.damping > 0.0))


def damps_against_goals(motion: Tracked) -> bool:
    """Whether an impedance law damps against the speed of goals that were logged without it.

    Some damp against zero, as libfranka's examples do: the recorded torque tells which, if clearly. Each law
    is compared with its command as late as suits it: a delay T takes K T dq from the torque, damping against
    zero D dq, so a late command looks like the other law with a wrong damping.
    """
    command = motion.recording.command
    # The recording first: without a recorded torque what is asked for is made by the command, which asks us.
    if command is None or not _may_damp_against_goals(motion.recording) or motion.asked is None:
        return False
    against_zero = _least_left(motion, command)
    return _least_left(motion, with_goals_speed(motion, command)) < CLEARLY * against_zero


def _least_left(motion: Tracked, command: JointSignal) -> float:
    """Power of the recorded torque that the law leaves, with its command as late as suits it best."""
    left = (motion.left_by_law(command, late) for late in LATE_S)
    return min(np.inf if each is None else float(np.mean(each**2)) for each in left)


def with_goals_speed(motion: Tracked, command: JointSignal) -> JointSignal:
    """A command with its positions' derivative; over jittered stamps it would be as far off."""
    assert command.position is not None
    times = motion.times_of(command.time, command.position).time
    return replace(command, velocity=find_slopes(times, command.position))


def _lacks_speed(recording: ArmRecording) -> bool:
    """Whether a law tracks positions alone, of which each acts until the next one comes in a line."""
    controller, command = recording.arm.controller, recording.command
    if controller is None or command is None or command.position is None or command.velocity is not None:
        return False
    return controller.between_commands != HELD


def _has_share(controller: ArmController) -> bool:
    return any(key.name == SHARE for key in KINDS[controller.kind].keys)
