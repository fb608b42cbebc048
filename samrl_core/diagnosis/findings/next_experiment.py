"""The recording that would split an ambiguity set: simulated discrimination over candidate trajectories.

T-optimal design (Atkinson and Fedorov 1975): of the trajectories at hand, the one in which the closest pair
of rivals differs most after the wrong one has been fitted to what the right one would do.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from samrl_core.cell.excitation.catalogue import KINDS
from samrl_core.cell.excitation.runs import Run, file_runs
from samrl_core.cell.excitation.trajectory_file import TrajectoryFile
from samrl_core.cell.robots.arm_model import Payload
from samrl_core.cell.robots.cells import robot_with_joints
from samrl_core.cell.robots.robot import ROLES
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.common.errors import SamrlError
from samrl_core.diagnosis.findings.discrimination import (
    FILE,
    Rivals,
    discrimination,
    find_rivals,
    separation,
)
from samrl_core.diagnosis.residuals.equations import nominal_friction
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.trial import Trial, as_arms
from samrl_core.diagnosis.result import NextExperiment
from samrl_core.diagnosis.selection.hypothesis import Fit
from samrl_core.diagnosis.selection.twins import AS_MUCH
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm

CANDIDATES = ("micro_reversals", "chirp", "static", "sweep", "slow", "multisine")
DURATION_S = 12.0
BY_RULE = 0.5  # of a trajectory that was chosen without simulation: nobody knows


def next_experiment(
    likelihood: Likelihood, fits: Sequence[Fit], names: Sequence[str], seed: int
) -> tuple[NextExperiment | None, str]:
    """A trajectory for the rivals with these `family@place` names; None for an arm without a role.

    None as well, and why, where those that were simulated split them no better than these recordings do.
    """
    (trial, *_) = as_arms(likelihood.trials)
    arm = trial.recording.arm
    if arm.role not in ROLES:
        return None, ""
    rivals = find_rivals(fits, names)
    places = (h.place for h, _ in rivals.values())
    joints = tuple(dict.fromkeys(p.removeprefix("joint:") for p in places if p.startswith("joint:")))

    def trajectory(kind: str) -> TrajectoryFile:
        return TrajectoryFile(arm.role, kind, joints, {"duration_s": DURATION_S, "seed": seed}, "")

    scored = _score(trial, rivals, [trajectory(kind) for kind in CANDIDATES], seed)
    pair = " and ".join(names[:3])
    if scored:
        best, file = max(scored, key=lambda item: item[0])
        if best < AS_MUCH:
            tried = ", ".join(f.kind for _, f in scored)
            return None, (
                f"no trajectory of `samrl excite` splits {pair}: logged as here they would differ by"
                f" {best:.1f} of log evidence at most (tried: {tried}); an outside measurement must"
            )
        why = f"{pair} would differ by {best:.0f} of log evidence in it; it shows {KINDS[file.kind].shows}"
        return _experiment(file, why, separation(best)), ""
    # What splits them elsewhere, by what most of them have in common.
    kinds = [rivals[name][0].effect.experiment if name in rivals else "slow" for name in names]
    kind, _ = Counter(kinds).most_common(1)[0]  # of as many, the first
    why = f"{pair}: {KINDS[kind].shows}; chosen by rule, they cannot be told apart by simulation here"
    return _experiment(trajectory(kind), why, BY_RULE), ""


def _score(
    trial: Trial, rivals: Rivals, candidates: Sequence[TrajectoryFile], seed: int
) -> list[tuple[float, TrajectoryFile]]:
    """Discrimination [nat] in each trajectory that this arm has room for; empty where none is simulated."""
    spec = robot_with_joints(trial.recording.arm.joints)
    if spec is None or len(rivals) < 2:  # one alone differs from none
        return []
    scored: list[tuple[float, TrajectoryFile]] = []
    for file in candidates:
        try:
            (run, *_) = file_runs("next", file, spec, _payload(trial))
        except SamrlError:
            continue  # this arm has no room for it
        scored.append((discrimination(_virtual(trial, run, seed), rivals), file))
    return scored


def _experiment(file: TrajectoryFile, why: str, separates: float) -> NextExperiment:
    content = {
        "schema": 1,
        "arm": file.arm,
        "kind": file.kind,
        "joints": list(file.joints),
        "parameters": {k: list(v) if isinstance(v, tuple) else v for k, v in file.parameters.items()},
        "why": why,
    }
    return NextExperiment(FILE, why, separates, content)


def _payload(trial: Trial) -> Payload | None:
    tool = trial.recording.arm.tool
    return None if tool is None else Payload(tool.mass, tool.center_of_mass, tool.inertia)


def _virtual(trial: Trial, run: Run, seed: int) -> Trial:
    """Recording of a nominal arm that follows the trajectory, logged as the real recordings are.

    With their noise and rate, and with the channels that they have: a speed or a torque that nobody logs
    separates nothing.
    """
    rigid = RigidArm(replace(trial.recording.arm, controller=run.controller))
    motion, noise, rng = trial.motion, trial.motion.noise, np.random.default_rng(seed)
    command = run.command
    assert command.position is not None and command.velocity is not None and command.acceleration is not None
    every = max(1, round(1.0 / (motion.rate * float(np.median(np.diff(command.time))))))
    time, position, velocity, acceleration = (
        x[::every] for x in (command.time, command.position, command.velocity, command.acceleration)
    )
    torque = rigid.inverse_dynamics(position, velocity, acceleration)

    def read(values: np.ndarray, deviation: np.ndarray, logged: bool) -> np.ndarray | None:
        return values + deviation * rng.standard_normal(values.shape) if logged else None

    states = JointSignal(
        time,
        read(position, noise.position, True),
        read(velocity, noise.velocity, motion.raw_velocity is not None),
        None,
        read(torque, noise.effort, motion.tau is not None),
    )
    friction = nominal_friction(trial.recording.arm, velocity)
    # A torque that the law stands for is as good as logged: the law is known.
    torque = torque + trial.rotor * acceleration + friction
    effort = read(torque, noise.commanded_effort, motion.u is not None)
    sent = None if effort is None else JointSignal(time, effort=effort)
    arm = replace(trial.recording.arm, controller=run.controller)
    return Trial(ArmRecording("next", "", "", arm, states, command, sent), rigid)
