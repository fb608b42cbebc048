"""Recordings simulated again with and without what was found: in closed loop, or forward without a law."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeGuard

import numpy as np

from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.common.errors import InputError, LimitError
from samrl_core.diagnosis.residuals.observed import Observed
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.selection.forward_windows import (
    WINDOW_S,
    Stages,
    begin_off,
    drivable,
    drive_forward,
    has_no_law,
)
from samrl_core.diagnosis.selection.gap_metric import (
    QUANTITIES,
    bootstrap_shrink,
    channel_scales,
    runs_away,
)
from samrl_core.diagnosis.selection.hypothesis import ONSET, Fit
from samrl_core.diagnosis.selection.tolerated_plant import sample_plant
from samrl_core.diagnosis.simulation.closed_loop import ClosedLoop, Rollouts
from samrl_core.diagnosis.simulation.loop_model import LoopModel
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters

PIECE_S = 1.0  # of what no loop holds: its errors grow without bound, whatever their cause
MACHINES = 8  # within tolerance, whose errors are the unit of an open loop's gap
BLOCK_S = 0.5  # of the bootstrap; longer than residuals stay correlated
_TOLERATED = ("tolerated errors", "open loop")  # in a trial's cache
UNITS = {"position": "rad", "velocity": "rad/s", "effort": "N m", "commanded_effort": "N m"}


@dataclass(frozen=True, eq=False)
class Resimulation:
    """One recording: time (N,), and channels (N, J) as measured and per simulated plant."""

    trial: Trial
    time: np.ndarray
    measured: dict[str, np.ndarray]
    simulated: dict[str, dict[str, np.ndarray]]  # plant name -> quantity -> (N, J)
    scales: dict[str, np.ndarray]  # (J,)


def simulable(trial: Observed) -> TypeGuard[Trial]:
    """Whether the recording's arm, controller and command suffice for a closed loop."""
    return (
        isinstance(trial, Trial)
        and trial.rigid is not None
        and trial.motion.dynamic
        and trial.recording.arm.controller is not None
        and trial.motion.drive_input is not None
    )


def resimulable(trial: Observed) -> TypeGuard[Trial]:
    """Whether the recording can be simulated again, in closed loop or forward from its efforts."""
    return simulable(trial) or drivable(trial)


def window_s(trial: Trial) -> float | None:
    """After how long a simulation begins anew from the log [s]; None where a loop holds every joint."""
    if not simulable(trial):
        return WINDOW_S
    controller = trial.recording.arm.controller
    return PIECE_S if controller is not None and runs_away(controller) else None


def plant_of(trial: Trial, fit: Fit) -> PlantParameters | None:
    """A plant with the fitted effects; None where one of them cannot be simulated."""
    changes: dict[str, np.ndarray | float] = {}
    neutral = PlantParameters()
    for h, a in zip(fit.hypotheses, fit.amplitudes, strict=True):
        fields = h.form.plant_fields(trial, h.shape, a)
        if fields is None:
            return None
        for name, value in fields.items():
            if name not in changes:
                changes[name] = value
                continue
            # Two effects on one field: each keeps its joints, and where both act they add up.
            base = np.broadcast_to(np.asarray(getattr(neutral, name), dtype=float), np.shape(value))
            before = np.asarray(changes[name], dtype=float)
            now = np.asarray(value, dtype=float)
            additive = np.isfinite(base) & (base == 0)
            merged = np.where(now != base, now, before)
            changes[name] = np.where(additive, before + now, merged)
    try:
        plant = replace(neutral, **changes)
    except InputError:
        return None  # a fit so far out that no plant is like it; its interval and alarms say so
    return plant if simulable(trial) or has_no_law(plant) else None


def from_start(signal: JointSignal | None, start: float) -> JointSignal | None:
    """A signal on a time axis that begins elsewhere."""
    return None if signal is None else replace(signal, time=signal.time - start)


def _in_pieces(
    loop: ClosedLoop,
    trial: Trial,
    command: JointSignal,
    enabled: JointSignal | None,
    stages: Stages,
    duration: float,
    every: int,
    off: Mapping[str, np.random.Generator],
) -> Rollouts:
    """Rollouts that begin anew from the measured state every `PIECE_S`: nothing else keeps them near it.

    Each with the plants of the stage in which it begins.
    """
    motion = trial.motion
    period = every * loop.model.step_s * loop.model.substeps
    length = max(1, round(PIECE_S / period)) * period
    parts = []
    for begin in np.arange(0.0, duration - 0.5 * length, length):
        last = begin + 1.5 * length > duration
        k = int(np.searchsorted(motion.time - motion.time[0], begin - 1e-9))
        later = replace(command, time=command.time - begin)
        plants = [of for since, of in stages if since <= begin][-1]
        part = loop.rollout(
            later, *begin_off(trial, k, plants, off), list(plants.values()),
            (duration - begin) if last else length - period, record_every=every,
            enabled=from_start(enabled, begin), keep_diverged=True,
        )  # fmt: skip
        parts.append(replace(part, time=part.time + begin))
    names = ("position", "velocity", "effort", "commanded_effort")
    joined = [np.concatenate([getattr(part, name) for part in parts], axis=1) for name in names]
    return Rollouts(np.concatenate([part.time for part in parts]), *joined)


def _motor_torque(
    trial: Trial, asked: np.ndarray, velocity: np.ndarray, grid: np.ndarray, time: np.ndarray
) -> np.ndarray:
    """Simulated effort (T, J) as `motion.raw_commanded` counts it: less what the motors' speed takes."""
    controller, motion = trial.recording.arm.controller, trial.motion
    assert controller is not None
    loss = controller.law.of_joints("back_emf", trial.joints)
    if not np.any(loss > 0):
        return asked
    index = np.clip(np.searchsorted(grid, time - 1e-9), 0, len(grid) - 1)
    powered = np.ones_like(asked) if controller.law.braked else motion.enabled[index]
    return asked - loss * powered * velocity


def over_time(trial: Trial, fits: Mapping[str, Fit]) -> Stages:
    """The nominal plant and those of sets by name, a stage for each time at which a member of one begins.

    What cannot be simulated is left out. A member that has no onset is there from the start. Sets of which
    nothing begins keep their plant.
    """
    whole = {name: fit for name, fit in fits.items() if plant_of(trial, fit) is not None}
    onsets = {name: {h.shape.get(ONSET, 0.0) for h in fit.hypotheses} for name, fit in whole.items()}
    plants, stages = {"nominal": PlantParameters()}, []
    for time in sorted({0.0}.union(*onsets.values())):
        for name, fit in whole.items():
            if time == 0.0 or time in onsets[name]:
                plant = plant_of(trial, _begun(fit, time))
                assert plant is not None  # as the whole set has one
                plants = {**plants, name: plant}
        stages.append((time, plants))
    return stages


def _begun(fit: Fit, time: float) -> Fit:
    """The members of a set that are there at a time [s]."""
    there = [k for k, h in enumerate(fit.hypotheses) if h.shape.get(ONSET, 0.0) <= time]
    return replace(
        fit,
        hypotheses=tuple(fit.hypotheses[k] for k in there),
        amplitudes=tuple(fit.amplitudes[k] for k in there),
    )


def resimulate(
    trial: Trial, stages: Stages, off: Mapping[str, np.random.Generator] | None = None
) -> Resimulation:
    """Simulate a recording's command with each plant. A plant that diverges is NaN from there on.

    Plants are those of the stage that has begun last, the first from the start. Those in `off` begin beside
    the log by its noise wherever no loop would take that back.
    """
    if not simulable(trial):
        return Resimulation(trial, *drive_forward(trial, stages, off))
    arm, motion = trial.recording.arm, trial.motion
    command = motion.drive_input
    assert trial.rigid is not None and command is not None and arm.controller is not None
    shifted = JointSignal(
        command.time - motion.time[0], command.position, command.velocity, None, command.effort
    )
    loop = ClosedLoop(LoopModel(arm))
    period = arm.controller.period_s
    every = max(1, round(1.0 / (motion.rate * period)))
    duration = float(motion.time[-1] - motion.time[0])
    start_q = np.median(motion.full_position[:5], axis=0)
    start_v = np.median(motion.full_velocity[:5], axis=0)
    switched = from_start(motion.recording.torque_enabled, motion.time[0])
    names = list(stages[0][1])
    free = runs_away(arm.controller)
    if free:
        rollouts = _in_pieces(loop, trial, shifted, switched, stages, duration, every, off or {})
    else:
        plants, later = _first_and_later(stages, every * period, duration - 10 * every * period)
        rollouts = loop.rollout(
            shifted, start_q, start_v, list(plants.values()), duration, record_every=every, enabled=switched,
            keep_diverged=True,
        )  # fmt: skip
        for begin, now in later:
            changed = {k: now[name] for k, name in enumerate(names) if now[name] is not plants[name]}
            rollouts = _switched_on(loop, rollouts, shifted, switched, changed, begin, duration, every)
            plants = now
    grid = motion.time - motion.time[0]
    length = int(np.searchsorted(grid, rollouts.time[-1] + 0.5 / motion.rate))
    open_loop = arm.controller.law.open_loop  # its effort is what was put in
    limits = np.where(np.isfinite(trial.rigid.effort_limits()), trial.rigid.effort_limits(), trial.scale)
    measured = {
        name: values[:length]
        for name, values in (
            ("position", motion.raw_position),
            ("velocity", motion.raw_velocity),
            ("effort", motion.raw_effort),
            ("commanded_effort", None if motion.computed or open_loop else motion.raw_commanded),
        )
        if values is not None
    }
    simulated = {}
    for k, name in enumerate(names):
        channels = {}
        for quantity in measured:
            values = getattr(rollouts, quantity)[k]
            if quantity == "commanded_effort":
                values = _motor_torque(trial, values, rollouts.velocity[k], grid, rollouts.time)
            channels[quantity] = np.stack(
                [np.interp(grid[:length], rollouts.time, column) for column in values.T], axis=1
            )
        simulated[name] = channels
    errors = _tolerated_errors(loop, trial, shifted, switched, duration, every) if free else None
    return Resimulation(trial, grid[:length], measured, simulated, channel_scales(arm, limits, errors))


def _tolerated_errors(
    loop: ClosedLoop,
    trial: Trial,
    command: JointSignal,
    enabled: JointSignal | None,
    duration: float,
    every: int,
) -> dict[str, np.ndarray]:
    """RMS error (J,) of position [rad] and velocity [rad/s] that tolerances and noise cause in the pieces.

    No loop holds an error back: it grows with the torque over the inertia, into whatever gravity, back-EMF
    and the other joints make of it. So machines within tolerance are simulated, once for a recording.
    """
    if _TOLERATED not in trial.cached:
        noise, rngs = trial.motion.noise, {f"machine {k}": np.random.default_rng(k) for k in range(MACHINES)}
        plants = {name: sample_plant(trial, rng) for name, rng in rngs.items()}
        stages = [(0.0, {"nominal": PlantParameters(), **plants})]
        runs = _in_pieces(loop, trial, command, enabled, stages, duration, every, rngs)
        trial.cached[_TOLERATED] = {  # what diverges counts until then
            name: np.hypot(np.sqrt(np.nanmean((values[1:] - values[:1]) ** 2, axis=(0, 1))), deviation)
            for name, values, deviation in (
                ("position", runs.position, noise.position),
                ("velocity", runs.velocity, noise.velocity),
            )
        }
    return trial.cached[_TOLERATED]


def _first_and_later(
    stages: Stages, soonest: float, latest: float
) -> tuple[Mapping[str, PlantParameters], Stages]:
    """Plants from the start, and the stages that begin between two times [s]; later ones are not reached."""
    first = [plants for begin, plants in stages if begin <= soonest]
    return first[-1], [stage for stage in stages if soonest < stage[0] < latest]


def _switched_on(
    loop: ClosedLoop,
    before: Rollouts,
    command: JointSignal,
    enabled: JointSignal | None,
    changed: Mapping[int, PlantParameters],
    onset: float,
    duration: float,
    every: int,
) -> Rollouts:
    """Rollouts (B, T, J) of which some, by index, go on with other plants from an onset [s].

    They go on from where they are, with a controller that has no past; what had diverged stays NaN.
    """
    k = int(np.searchsorted(before.time, onset))
    begin = float(before.time[k])
    there = [b for b in changed if np.all(np.isfinite([before.position[b, k], before.velocity[b, k]]))]
    if not there:
        return before
    later = JointSignal(
        command.time - begin, command.position, command.velocity, command.acceleration, command.effort
    )
    rest = loop.rollout(
        later,
        before.position[there, k],
        before.velocity[there, k],
        [changed[b] for b in there],
        duration - begin,
        record_every=every,
        enabled=from_start(enabled, begin),
        keep_diverged=True,
    )
    length = min(len(before.time) - k, len(rest.time))

    def joined(name: str) -> np.ndarray:
        values = getattr(before, name)[:, : k + length].copy()
        values[there, k:] = getattr(rest, name)[:, :length]
        return values

    names = ("position", "velocity", "effort", "commanded_effort")
    return Rollouts(before.time[: k + length], *(joined(name) for name in names))


def pointwise(resimulation: Resimulation, plant: str, quantities: Sequence[str] = QUANTITIES) -> np.ndarray:
    """Mean squared error over channels and joints in units of the scales, per sample (N,)."""
    parts = [
        ((resimulation.measured[q] - resimulation.simulated[plant][q]) / resimulation.scales[q]) ** 2
        for q in quantities
        if q in resimulation.measured
    ]
    return np.mean(np.concatenate(parts, axis=1), axis=1)


def gap(resimulations: Sequence[Resimulation], plant: str, quantities: Sequence[str] = QUANTITIES) -> float:
    """The gap metric over all recordings; infinite where the simulation diverged."""
    errors = np.concatenate([pointwise(r, plant, quantities) for r in resimulations])
    return float(np.sqrt(np.mean(errors))) if np.isfinite(errors).all() else float("inf")


def shrink_interval(
    resimulations: Sequence[Resimulation], plant: str, rng: np.random.Generator, beside: str = "nominal"
) -> tuple[float, float]:
    """95 % block-bootstrap interval of the shrink from the nominal plant, or the one `beside`, to another."""
    blocks = []
    for r in resimulations:
        before, after = pointwise(r, beside), pointwise(r, plant)
        size = max(1, int(BLOCK_S * r.trial.motion.rate))
        for start in range(0, len(before), size):
            part = slice(start, start + size)
            blocks.append((float(np.sum(before[part])), float(np.sum(after[part]))))
    sums = np.array(blocks)
    if not np.isfinite(sums).all():
        raise LimitError(f"the re-simulation with {plant} diverged on held-out data")
    return bootstrap_shrink(sums, rng)
