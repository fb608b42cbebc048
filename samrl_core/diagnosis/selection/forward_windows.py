"""A recording without a described controller, simulated forward from the efforts that were logged.

An open loop runs away from the log within seconds, whatever the model; over a short window it does not. Each
window starts where the log was, is driven by the logged effort alone, and its errors of position and velocity
count in units of what tolerated torques and the start's noise would cause over the same time. This is the
simulated gap where no law is known: it weighs effects by what they do to the motion, and not by the torque
that they explain.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypeGuard

import numpy as np

from samrl_core.cell.types.arm_description import ArmController
from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.diagnosis.residuals.observed import Observed
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.simulation.closed_loop import ClosedLoop
from samrl_core.diagnosis.simulation.loop_model import LoopModel
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters

WINDOW_S = 0.4
MOST_WINDOWS = 16  # of a recording, spread evenly
LONGEST_STEP_S = 0.002
LONGEST_HELD_S = 1.0 / 60.0  # an effort; between samples of a slower log it runs straight
SHORT_HELD_S = 0.005
# Plants by name from a time [s] on; the first from the start, all of the same names in the same order.
Stages = Sequence[tuple[float, Mapping[str, PlantParameters]]]
BY_THE_LAW = ("stiffness_scale", "damping_scale", "command_delay", "command_cutoff")  # fields of a controller


def drivable(trial: Observed) -> TypeGuard[Trial]:
    """Whether the recording has a model and the efforts that moved it."""
    return (
        isinstance(trial, Trial)
        and trial.rigid is not None
        and trial.motion.dynamic
        and trial.motion.raw_commanded is not None
        and float(trial.motion.time[-1] - trial.motion.time[0]) > 3 * WINDOW_S
    )


def has_no_law(plant: PlantParameters) -> bool:
    """Whether nothing of the plant acts in the controller, which these windows do without."""
    neutral = PlantParameters()
    return all(np.array_equal(getattr(plant, name), getattr(neutral, name)) for name in BY_THE_LAW)


def drive_forward(
    trial: Trial, stages: Stages, off: Mapping[str, np.random.Generator] | None = None
) -> tuple[np.ndarray, dict[str, np.ndarray], dict[str, dict[str, np.ndarray]], dict[str, np.ndarray]]:
    """Time (N,) of all windows one after another, measured and simulated channels (N, J), scales (J,).

    Plants that diverge are NaN from there on; they are those of the stage in which a window starts. Those in
    `off` start beside the log by its noise, drawn anew for each window.
    """
    motion, arm = trial.motion, trial.recording.arm
    assert trial.rigid is not None and motion.raw_commanded is not None and motion.raw_position is not None
    period = 1.0 / motion.rate
    every = int(np.ceil(period / SHORT_HELD_S)) if period > LONGEST_HELD_S else 1  # steps a sample
    zeros, period = np.zeros(trial.joints), period / every
    law = ArmController(
        arm.joints, zeros, zeros, period, gravity_compensation=False,
        gravity=tuple(trial.rigid.gravity_vector), effort_limit=np.full(trial.joints, np.inf),
        armature=trial.rotor,
    )  # fmt: skip
    substeps = max(1, int(np.ceil(period / LONGEST_STEP_S)))
    loop = ClosedLoop(LoopModel(replace(arm, controller=law), substeps=substeps))
    length = round(WINDOW_S * motion.rate)
    edge = max(motion.edge, 3)
    last = len(motion.time) - edge - length - 1
    count = int(np.clip((last - edge) // length, 1, MOST_WINDOWS))
    times, measured, simulated = [], {"position": [], "velocity": []}, {name: {} for name in stages[0][1]}
    for start in np.linspace(edge, last, count).astype(int):
        part = slice(start, start + length + 1)
        time = motion.time[part] - motion.time[start]
        driven = _driven(time, motion.raw_commanded[part], every)
        plants = [of for begin, of in stages if begin <= motion.time[start] - motion.time[0]][-1]
        runs = loop.rollout(
            driven,
            *begin_off(trial, start, plants, off or {}),
            list(plants.values()),
            float(time[-1]),
            record_every=every,
            keep_diverged=True,
        )
        kept = min(len(runs.time), length + 1)
        times.append(motion.time[part][:kept] - motion.time[0])
        measured["position"].append(motion.full_position[part][:kept])
        measured["velocity"].append(motion.full_velocity[part][:kept])
        for k, name in enumerate(plants):
            for quantity in measured:
                simulated[name].setdefault(quantity, []).append(getattr(runs, quantity)[k][:kept])
    return (
        np.concatenate(times),
        {q: np.concatenate(x) for q, x in measured.items()},
        {name: {q: np.concatenate(x) for q, x in parts.items()} for name, parts in simulated.items()},
        _scales(trial),
    )


def begin_off(
    trial: Trial, sample: int, plants: Mapping[str, PlantParameters], off: Mapping[str, np.random.Generator]
) -> tuple[np.ndarray, np.ndarray]:
    """Position and velocity (B, J) from which plants start at a sample; off by the log's noise for `off`."""
    motion = trial.motion
    position, velocity = (
        np.tile(x[sample], (len(plants), 1)) for x in (motion.full_position, motion.full_velocity)
    )
    deviations = np.sqrt(motion.band_share) * motion.noise.position, _start_speeds(trial)
    for k, name in enumerate(plants):
        if name in off:
            position[k] += deviations[0] * off[name].standard_normal(trial.joints)
            velocity[k] += deviations[1] * off[name].standard_normal(trial.joints)
    return position, velocity


def _start_speeds(trial: Trial) -> np.ndarray:
    """Standard deviation (J,) of the velocities at which windows start."""
    motion = trial.motion
    if motion.raw_velocity is not None:
        return np.sqrt(motion.band_share) * motion.noise.velocity
    return np.sqrt(np.maximum(motion.velocity_noise(), 0.0))


def _driven(time: np.ndarray, effort: np.ndarray, every: int) -> JointSignal:
    """Logged efforts (N, J) as a controller gives them that tracks nothing, `every` times between samples."""
    fine = np.interp(np.arange((len(time) - 1) * every + 1) / every, np.arange(len(time)), time)
    given = np.stack([np.interp(fine, time, column) for column in effort.T], axis=1)
    idle = np.zeros_like(given)
    return JointSignal(fine, idle, idle, None, given)


def _scales(trial: Trial) -> dict[str, np.ndarray]:
    """Error (J,) that a tolerated torque and the start's noise cause over a window, typically."""
    tolerances = trial.recording.arm.tolerances
    limit = np.asarray(trial.scale)
    torque = limit * np.hypot(np.asarray(tolerances.torque_offset), np.asarray(tolerances.coulomb_friction))
    inertia = np.mean(np.diagonal(trial.mass, axis1=1, axis2=2), axis=0) + trial.rotor
    acceleration = np.maximum(torque, 1e-4 * limit) / inertia
    speed = _start_speeds(trial)
    return {
        "position": np.hypot(acceleration * WINDOW_S**2 / 4.0, speed * WINDOW_S / 2.0),
        "velocity": np.hypot(acceleration * WINDOW_S / 2.0, speed),
    }
