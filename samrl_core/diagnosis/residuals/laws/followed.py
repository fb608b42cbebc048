"""What a described servo does with its command, where a log tells nothing but where the joints were.

A servo without an integral gives way to weight, and every servo is late. Against the command alone a machine
with nothing wrong has both as a gap; against its own law and model, simulated, it has none.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from samrl_core.cell.types.arm_description import HELD
from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.diagnosis.residuals.motion import RecordedMotion
from samrl_core.diagnosis.simulation.closed_loop import ClosedLoop
from samrl_core.diagnosis.simulation.loop_model import LoopModel
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters


def followed_position(motion: RecordedMotion) -> np.ndarray | None:
    """Positions (F, J) of the nominal machine under its law; None where nobody describes one, or it diverges.

    From the first reading on, at rest there, so that the beginning is not the machine's own.
    """
    command, controller = motion.recorded_command, motion.controller
    if motion.arm is None or controller is None or command is None or command.position is None:
        return None
    if controller.law.open_loop or motion.raw_position is None:
        return None
    start, period = motion.time[0], controller.period_s
    duration = float(motion.time[-1] - start)
    given = JointSignal(command.time - start, command.position, command.velocity, None, command.effort)
    if controller.between_commands == HELD:
        given = _held(given, period, duration)
    switched = motion.recording.torque_enabled
    loop = ClosedLoop(LoopModel(motion.recording.arm))
    runs = loop.rollout(
        given, motion.raw_position[0], np.zeros(motion.joints), [PlantParameters()], duration,
        record_every=max(1, int(1.0 / (motion.rate * period * 4.0))), keep_diverged=True,
        enabled=None if switched is None else replace(switched, time=switched.time - start),
    )  # fmt: skip
    went = runs.position[0]
    if not np.isfinite(went).all():
        return None
    return np.stack([np.interp(motion.time - start, runs.time, q) for q in went.T], axis=1)


def _held(given: JointSignal, period: float, duration: float) -> JointSignal:
    """A command at every period of its controller, which keeps each until the next one."""
    time = np.arange(0.0, duration + period, period)
    at = np.clip(np.searchsorted(given.time, time + 1e-9, side="right") - 1, 0, len(given) - 1)
    position, velocity, effort = (
        None if x is None else x[at] for x in (given.position, given.velocity, given.effort)
    )
    return JointSignal(time, position, velocity, None, effort)
