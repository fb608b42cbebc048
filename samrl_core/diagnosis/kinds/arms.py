"""Recordings of one arm's joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from samrl_core.cell.types.arm_description import HELD, LINE
from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.effects import EFFECTS, NOT_BY_JOINTS
from samrl_core.diagnosis.effects.effect import too_slow_for_torques
from samrl_core.diagnosis.export.correction import Correction
from samrl_core.diagnosis.findings.curves import curve_of
from samrl_core.diagnosis.findings.joint_units import with_joint_units
from samrl_core.diagnosis.findings.next_experiment import next_experiment
from samrl_core.diagnosis.findings.posterior import correction_of
from samrl_core.diagnosis.kinds.kind import Kind
from samrl_core.diagnosis.recordings import split
from samrl_core.diagnosis.recordings.in_common import in_common
from samrl_core.diagnosis.recordings.velocity_lag import set_apart
from samrl_core.diagnosis.residuals.field_time import with_field_time
from samrl_core.diagnosis.residuals.laws.commanded_speed import damps_against_goals, infers_speed
from samrl_core.diagnosis.residuals.laws.law_velocity import with_law_velocity
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.observed import Observed
from samrl_core.diagnosis.residuals.signals.sample_times import regular
from samrl_core.diagnosis.residuals.signals.signal_noise import (
    FAST_HZ,
    is_fast,
    tells_accelerations,
    without_differences,
)
from samrl_core.diagnosis.residuals.trial import Trial, as_arms
from samrl_core.diagnosis.result import Curve, Diagnosis, NextExperiment
from samrl_core.diagnosis.selection.description import WrongDescription, misdescription
from samrl_core.diagnosis.selection.exceeded_limits import find_exceeded_limits
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit
from samrl_core.diagnosis.selection.resimulation import simulable
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from samrl_core.diagnosis.verdict.foils import Foils
from samrl_core.diagnosis.verdict.how_far import HowFar
from samrl_core.diagnosis.verdict.judge import Doubts

GOALS_APART = 1.5  # periods of the controller: from here on what it does between two goals is a question


class Arms(Kind[ArmRecording]):
    """Joint positions, efforts and commands against a URDF and a controller."""

    effects = EFFECTS
    elsewhere = NOT_BY_JOINTS
    shown_by = "joint channels"
    nothing = "no channel of the recordings can be compared with a model"

    def alike(self, recordings: Sequence[ArmRecording]) -> tuple[list[ArmRecording], list[str]]:
        first = recordings[0].arm
        for other in recordings[1:]:
            if other.arm.joints != first.joints:
                raise InputError(
                    f"{other.name} has joints {other.arm.joints}, {recordings[0].name} has {first.joints}; "
                    "diagnose one arm at a time"
                )
        found, notes = in_common(recordings)
        if not all(is_fast(log_rate(r)) for r in found):
            return found, notes  # a slow log may need its velocities to tell accelerations
        found, lag = set_apart(found)
        if lag <= 0.0:
            return found, notes
        found, law = with_law_velocity(found, lag)
        late = f"the logged velocity is {1e3 * lag:.1f} ms behind the positions, as a driver's filter has it"
        return found, [*notes, f"{late}: motion is taken as their derivative{law}"]

    def usable(
        self, fit: Sequence[ArmRecording], held_out: Sequence[ArmRecording]
    ) -> tuple[Sequence[ArmRecording], Sequence[ArmRecording], list[str]]:
        wanted = any(forms_dynamics(r) for r in fit)
        notes = []
        for recording in (*fit, *held_out):
            if forms_dynamics(recording) != wanted:
                slow = recording if wanted else fit[0]
                notes.append(
                    f"{recording.name} is left out: {slow.name} does not tell accelerations at"
                    f" {log_rate(slow):.3g} Hz, and {'others do' if wanted else 'this one does'}; log at"
                    f" {FAST_HZ:.0f} Hz or more, or move slower"
                )
        fitted, others = ([r for r in part if forms_dynamics(r) == wanted] for part in (fit, held_out))
        fitted, others, late = with_field_time(fitted, others)
        return fitted, others, [*notes, *late]

    def trials(
        self, fit: Sequence[ArmRecording], held_out: Sequence[ArmRecording]
    ) -> tuple[list[Observed], list[Observed]]:
        made = arm_trials(fit, held_out)
        return list(made[0]), list(made[1])

    def why_nothing(self, trials: Sequence[Observed]) -> str:
        for trial in as_arms(trials):
            motion = trial.motion
            if slow := too_slow_for_torques(trial):
                return slow
            if trial.rigid is None and motion.has_torque:
                return (
                    f"{trial.recording.name} holds torques, but no description of the arm to compare them"
                    " with: give its URDF by --urdf FILE, or record /robot_description"
                )
            if not motion.has_torque and trial.recording.command is None:
                return (
                    f"{trial.recording.name} holds how the joints moved, but neither efforts nor what was"
                    " commanded: record one of them"
                )
        return self.nothing

    def system(self, trial: Observed) -> str:
        return as_arms([trial])[0].recording.arm.role

    def cut(self, recording: ArmRecording) -> tuple[ArmRecording, ArmRecording]:
        return split(recording, 0.5)

    def next_experiment(
        self, likelihood: Likelihood, fits: Sequence[Fit], names: Sequence[str], seed: int
    ) -> tuple[NextExperiment | None, str]:
        return next_experiment(likelihood, fits, names, seed)

    def notes(self, trials: Sequence[Observed]) -> list[str]:
        first = as_arms(trials)[0]
        slow = too_slow_for_torques(first)
        unused = [f"the recorded torques are not used: {slow}"] if slow else []
        return [*unused, *_filter_notes(first), *_speed_notes(first), *_goal_notes(first)]

    def misdescription(self, trials: Sequence[Observed]) -> WrongDescription | None:
        return find_exceeded_limits(as_arms(trials)) or misdescription(as_arms(trials))

    def doubts_of(self, fitted: Likelihood, held_out: Likelihood) -> Doubts:
        return Foils(fitted, held_out).doubts

    def curve(self, evidence: Evidence, chosen: Fit, index: int) -> Curve | None:
        return curve_of(evidence, chosen, chosen.hypotheses[index])

    def correction(
        self, evidence: Evidence, chosen: Fit, far: HowFar, sure: bool, rng: np.random.Generator
    ) -> Correction | None:
        closed = tuple(r for r in far.resimulations if simulable(r.trial))  # an export replays the law
        return correction_of(evidence, chosen, closed, far.gap, rng)

    def finish(self, diagnosis: Diagnosis, trial: Observed) -> Diagnosis:
        return with_joint_units(diagnosis, as_arms([trial])[0].recording.arm)


def _filter_notes(first: Trial) -> list[str]:
    """Of torques that a driver filtered."""
    told = (("joints' torque sensors", first.effort_lag), ("torque that the drives report", first.torque_lag))
    return [
        f"the noise of the {what} is that behind a low-pass of about {1e3 * lag:.0f} ms: it is taken to be as"
        " large as it is where motions are, and the torque may be as late as that"
        for what, lag in told
        if lag > 0.0
    ]


def _speed_notes(first: Trial) -> list[str]:
    """Of a commanded speed that nobody recorded."""
    if damps_against_goals(first.motion):
        return [
            "the law damps against the speed of what was commanded, which holds positions alone: it is their"
            " derivative, as the recorded torque tells; if the controller damps against zero, log a commanded"
            " velocity of zero"
        ]
    if _holds_goals_without_speed(first.recording):
        return [
            "the velocity fed forward counts as zero: give the mapping's command `velocity: derivative` if"
            " the controller knows its goals' speed, else state `velocity_feedforward: 0` (the command holds"
            " none, and each goal is held until the next)"
        ]
    if not infers_speed(first.recording):
        return []
    return [
        "the law feeds the commanded velocity forward, and the command holds none: it is taken as the"
        " derivative of the commanded position; if the controller feeds none either, state"
        " `velocity_feedforward: 0`"
    ]


def _holds_goals_without_speed(recording: ArmRecording) -> bool:
    """Whether a law feeds a speed forward that would be the goals' own, were they not held."""
    controller = recording.arm.controller
    if controller is None or controller.between_commands != HELD:
        return False
    in_a_line = replace(controller, between_commands=LINE)
    return infers_speed(replace(recording, arm=replace(recording.arm, controller=in_a_line)))


def _goal_notes(first: Trial) -> list[str]:
    """Of what happens between two goals."""
    controller, command = first.recording.arm.controller, first.recording.command
    if controller is None or command is None or command.position is None or not first.motion.computed:
        return []
    spacing = float(np.median(np.diff(command.time)))
    if controller.between_commands == HELD or spacing < GOALS_APART * controller.period_s:
        return []
    return [
        f"a goal comes every {1e3 * spacing:.3g} ms, and the controller is taken to follow a line between"
        " two. If it keeps each until the next one, state `between_commands: held` in a mapping's"
        " controller (`samrl bag draft` writes a mapping): what is held looks like"
        f" {500 * spacing:.3g} ms of delay"
    ]


def log_rate(recording: ArmRecording) -> float:
    """Samples a second of the states [Hz]."""
    return 1.0 / float(np.median(np.diff(regular(recording.states.time))))


def forms_dynamics(recording: ArmRecording) -> bool:
    """Whether equations of motion can be formed: a slow log needs torques and a motion that it follows."""
    rate = log_rate(recording)
    torque = recording.commanded_effort is not None or recording.states.effort is not None
    return is_fast(rate) or (torque and tells_accelerations(without_differences(recording.states), rate))


def arm_trials(
    fit: Sequence[ArmRecording], held_out: Sequence[ArmRecording]
) -> tuple[list[Trial], list[Trial]]:
    """Trials of one session: their clocks follow one another.

    Raises:
        InputError: recordings that allow other channels than the fitted ones have in common, or tolerances
            per joint that are not as many as joints.
    """
    start, out = 0.0, []
    for recording in [*fit, *held_out]:
        recording.arm.tolerances.check_joints(recording.arm.joints, recording.name)
        rigid = RigidArm(recording.arm) if recording.arm.urdf is not None else None
        out.append(Trial(recording, rigid, start))
        start += recording.duration
    fitted = out[: len(fit)]
    for trial in out:
        trial.share_ranges(fitted)
    common = set.intersection(*(set(t.channels) for t in fitted))
    if not common and any(t.channels for t in fitted):
        each = "; ".join(f"{t.name}: {', '.join(t.channels) or 'none'}" for t in fitted)
        raise InputError(f"no channel can be formed of all fitted recordings ({each}); fit them one by one")
    for trial, recording in zip(out, [*fit, *held_out], strict=True):
        if set(trial.channels) != common and not set(trial.channels) >= common:
            raise InputError(
                f"{recording.name} allows {trial.channels}, the others {sorted(common)}; "
                "record the same topics in all of them"
            )
    return fitted, out[len(fit) :]
