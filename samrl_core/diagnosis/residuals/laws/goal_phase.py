"""When, within the time that a goal is held, a log read the torque of the drive that follows it.

A goal that is held jumps, and a stiff loop answers with a saw-tooth: most torque when the goal comes, least
before the next. A host that reads once per goal always reads at one place of that tooth, what it reads is the
torque of that moment, and the motion feels the mean. Right before the next goal a hobby servo of 19 N m/rad
told a goal every 10 ms shows 0.075 N m per rad/s too little, at every joint: as friction that is not there.
No log says when it read. Where it read now before and now after a goal's arrival, the row's goal is that of
the tooth before: noise that grows with the goal's speed.
"""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.residuals.laws.control_law import position_error
from samrl_core.diagnosis.residuals.laws.late_law import late_law_change
from samrl_core.diagnosis.residuals.motion import RecordedMotion

EITHER = 0.25  # variance of what is zero or one, whichever is as likely: no more is in a row's choice of goal
RESOLVED = 4.0  # samples per goal, from which on a log holds the tooth itself


def reading_time(motion: RecordedMotion) -> float:
    """Time [s] by which a reading may be off the middle of the tooth; zero where there is none."""
    controller, command = motion.controller, motion.recording.command
    read = motion.recording.commanded_effort is not None
    if controller is None or not read or not motion.holds_commands or motion.command is None:
        return 0.0
    assert command is not None
    step = 1.0 / motion.rate
    spacing = float(np.median(np.diff(command.time)))
    if spacing > RESOLVED * step or motion.holds_every_torque:
        return 0.0
    return 0.5 * min(spacing, step)


def tooth_rates(motion: RecordedMotion) -> tuple[np.ndarray, np.ndarray]:
    """Torques (F, J) per second that a spring loses between two goals, and gains as goals arrive.

    A joint that follows evenly moves as its goals do; one that is slow, or jumps within a goal, moves later.
    """
    controller, command, position = motion.controller, motion.command, motion.raw_position
    assert controller is not None and command is not None and position is not None
    assert command.position is not None
    pulls = position_error(controller, command.position, position) != 0.0  # beyond the dead band
    lost = controller.stiffness * pulls * motion.sure_velocity
    return lost, late_law_change(motion, 1.0 / motion.rate) * motion.rate


def widen_with_goals(sigma: np.ndarray, motion: RecordedMotion, raw: np.ndarray) -> np.ndarray:
    """Noise (N, J), larger where goals move, of rows that may hold the goal before or after.

    Args:
        sigma: noise (N, J) [N m], with the mean of it as it is in the white noise of the channel.
        motion: of the recording.
        raw: the law less the recorded torque (F, J) [N m], whose detail tells how often rows do.
    """
    if reading_time(motion) == 0.0:
        return sigma
    squares = late_law_change(motion, 1.0 / motion.rate) ** 2
    more = _share(raw, squares) * (squares - np.mean(squares, axis=0))
    added = motion.reduce_variance(np.maximum(more, 0.0), np.zeros(more.shape, dtype=bool))
    return np.hypot(sigma, np.sqrt(np.maximum(added, 0.0)))


def _share(raw: np.ndarray, squares: np.ndarray) -> float:
    """Variance, in squared teeth (F, J), of the residual (F, J) from row to row, the same for all joints."""
    detail = np.diff(raw, axis=0) ** 2 / 2.0  # of white noise: its variance
    at = 0.5 * (squares[1:] + squares[:-1])
    apart, off = at - np.mean(at, axis=0), detail - np.mean(detail, axis=0)
    weight = 1.0 / np.maximum(np.mean(detail, axis=0), 1e-300) ** 2  # of each joint
    power = float(np.sum(weight * np.sum(apart**2, axis=0)))
    slope = float(np.sum(weight * np.sum(apart * off, axis=0))) / power if power > 0.0 else 0.0
    return float(np.clip(slope, 0.0, EITHER))
