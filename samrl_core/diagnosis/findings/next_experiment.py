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
from samrl_core.diagnosis.residuals.equations import nominal_friction
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.observed import Observed
from samrl_core.diagnosis.residuals.trial import Trial, as_arms
from samrl_core.diagnosis.result import NextExperiment
from samrl_core.diagnosis.selection.hypothesis import Fit, Hypothesis, hypothesis
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm

CANDIDATES = ("micro_reversals", "chirp", "static", "sweep", "slow", "multisine")
DURATION_S = 12.0
NAT_PER_CERTAINTY = 3.0  # discrimination [nat] at which 63 % are told apart
FILE = "next.yaml"


def next_experiment(
    likelihood: Likelihood, fits: Sequence[Fit], names: Sequence[str], seed: int
) -> NextExperiment | None:
    """Propose a trajectory for the rivals with these `family@place` names; None for an arm without a role."""
    (trial, *_) = as_arms(likelihood.trials)
    arm = trial.recording.arm
    if arm.role not in ROLES:
        return None
    rivals: dict[str, tuple[Hypothesis, np.ndarray]] = {}
    for fit in fits:
        h = fit.hypotheses[0]
        if h.name in names:
            rivals.setdefault(h.name, (h, fit.amplitudes[0]))
    joints = tuple(
        dict.fromkeys(n.partition(":")[2] for n in (h.place for h, _ in rivals.values()) if n[:6] == "joint:")
    )
    spec = robot_with_joints(arm.joints)
    scored: list[tuple[float, TrajectoryFile]] = []
    if spec is not None and len(rivals) > 1:  # one alone differs from none
        for kind in CANDIDATES:
            file = TrajectoryFile(arm.role, kind, joints, {"duration_s": DURATION_S, "seed": seed}, "")
            try:
                (run, *_) = file_runs("next", file, spec, _payload(trial))
            except SamrlError:
                continue  # this arm has no room for it
            scored.append((discrimination(_virtual(trial, run), list(rivals.values())), file))
    pair = " and ".join(names[:3])
    if scored:
        best, file = max(scored, key=lambda item: item[0])
        why = f"{pair} would differ by {best:.0f} of log evidence in it; it shows {KINDS[file.kind].shows}"
        separates = float(1.0 - np.exp(-best / NAT_PER_CERTAINTY))
    else:
        # What splits them elsewhere, by what most of them have in common.
        kinds = [rivals[name][0].effect.experiment if name in rivals else "slow" for name in names]
        kind, _ = Counter(kinds).most_common(1)[0]  # of as many, the first
        file = TrajectoryFile(arm.role, kind, joints, {"duration_s": DURATION_S, "seed": seed}, "")
        why = f"{pair}: {KINDS[kind].shows}; chosen by rule, they cannot be told apart by simulation here"
        separates = 0.5
    file = replace(file, why=why)
    content = {
        "schema": 1,
        "arm": file.arm,
        "kind": file.kind,
        "joints": list(file.joints),
        "parameters": {k: list(v) if isinstance(v, tuple) else v for k, v in file.parameters.items()},
        "why": file.why,
    }
    return NextExperiment(FILE, why, separates, content)


def _payload(trial: Trial) -> Payload | None:
    tool = trial.recording.arm.tool
    return None if tool is None else Payload(tool.mass, tool.center_of_mass, tool.inertia)


def _virtual(trial: Trial, run: Run) -> Trial:
    """Recording of a nominal arm that follows the trajectory, with the noise of real recordings."""
    rigid = RigidArm(replace(trial.recording.arm, controller=run.controller))
    command = run.command
    assert command.position is not None and command.velocity is not None and command.acceleration is not None
    torque = rigid.inverse_dynamics(command.position, command.velocity, command.acceleration)
    rng = np.random.default_rng(0)
    noise = trial.motion.noise

    def noisy(values: np.ndarray, deviation: np.ndarray) -> np.ndarray:
        return values + deviation * rng.standard_normal(values.shape)

    states = JointSignal(
        command.time,
        noisy(command.position, noise.position),
        noisy(command.velocity, noise.velocity),
        None,
        noisy(torque, noise.effort) if "link" in trial.channels else None,
    )
    rotor = trial.rotor * command.acceleration
    friction = nominal_friction(trial.recording.arm, command.velocity)
    sent = JointSignal(command.time, effort=torque + rotor + friction)
    arm = replace(trial.recording.arm, controller=run.controller)
    return Trial(ArmRecording("next", "", "", arm, states, command, sent), rigid)


def discrimination(virtual: Observed, rivals: Sequence[tuple[Hypothesis, np.ndarray]]) -> float:
    """Smallest energy [nat] over ordered pairs that remains when the wrong rival is fitted."""
    likelihood = Likelihood([virtual])
    least = np.inf
    made = [(hypothesis(likelihood, h.effect, h.form, h.shape), a) for h, a in rivals]
    for i, (truth, a) in enumerate(made):
        if truth is None:
            continue
        own = likelihood.combined(truth.regressors, a)
        energy = float(likelihood.tempered_gram(own, own, 2.0)[0, 0])
        for j, (wrong, _) in enumerate(made):
            if i == j or wrong is None:
                continue
            cross = likelihood.tempered_gram(wrong.regressors, own, 2.0)[:, 0]
            gram = likelihood.tempered_gram(wrong.regressors, wrong.regressors, 2.0)
            # Beyond what the wrong one does at its prior's mean, which is its presence where it has no size.
            whole = energy - 2.0 * float(wrong.mean @ cross) + float(wrong.mean @ gram @ wrong.mean)
            cross = cross - gram @ wrong.mean
            gram = gram + np.diag(1.0 / wrong.spread**2)
            least = min(least, 0.5 * (whole - float(cross @ np.linalg.solve(gram, cross))))
    return float(max(least, 0.0)) if np.isfinite(least) else 0.0
