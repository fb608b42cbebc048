"""Calibrates the threshold of log evidence: the library's largest one on simulated worlds without any effect.

    python -m samrl_core.blind_test.scores.calibrate --worlds 24 --out calibration.json

Worlds are the diagnosis' own closed-loop simulations of the excitation trajectories, never those of the
forge: worlds of the test must not tune the diagnosis. Numbers: msgs_docs/results/blind_study.md.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from samrl_core.cell.excitation.excitation_trajectory import make_trajectory
from samrl_core.cell.robots.arm_model import Payload
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.robots.robot import ROLES
from samrl_core.cell.robots.urdf import description_of
from samrl_core.cell.types.arm_description import ArmController, ArmDescription, NominalTool
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.common.files import write_whole
from samrl_core.diagnosis.effects import EFFECTS
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.selection.null_simulations import (
    QUANTILE,
    best_log_evidence,
    sample_plant,
    simulate_null_recordings,
    threshold,
)
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm

KINDS = ("slow", "multisine")
NOISE = {"position": 3e-5, "velocity": 1e-3, "effort": 0.04}  # [rad, rad/s, N m] as forged and real sensors
TOOL = NominalTool(0.78, np.array([0.0, 0.0, 0.06]), np.diag([0.003, 0.003, 0.001]))
ARMATURE = 0.1  # [kg m2]
WIDE = 1.0 / 3.0  # of the worlds have backgrounds of up to twice the stated tolerances


def trials_of(role: str, number: int, duration_s: float) -> list[Trial]:
    """Nominal recordings of an arm's excitation trajectories with the noise of the cell's sensors."""
    spec = cell_named().arm(role)
    payload = Payload(TOOL.mass, TOOL.center_of_mass, TOOL.inertia)
    controller = ArmController(
        spec.joint_names,
        spec.controller.stiffness,
        spec.controller.damping,
        spec.controller.period_s,
        effort_limit=spec.limits.effort,
        armature=np.full(len(spec.joint_names), ARMATURE),
    )
    arm = ArmDescription(role, spec.joint_names, description_of(spec), controller, TOOL)
    rigid, out = RigidArm(arm), []
    rng = np.random.default_rng([number, 7])
    for kind in KINDS:
        command = make_trajectory(spec, payload, kind, number, duration_s)
        assert command.position is not None and command.velocity is not None
        torque = rigid.gravity(command.position)

        def noisy(values: np.ndarray, level: float, rng: np.random.Generator = rng) -> np.ndarray:
            return values + level * rng.standard_normal(values.shape)

        states = JointSignal(
            command.time,
            noisy(command.position, NOISE["position"]),
            noisy(command.velocity, NOISE["velocity"]),
            None,
            noisy(torque, NOISE["effort"]),
        )
        sent = JointSignal(command.time, effort=torque)
        out.append(Trial(ArmRecording(kind, "", "", arm, states, command, sent), rigid))
    return out


def main() -> None:
    """Simulate, print log evidences and the threshold, and write them as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", type=int, default=24)
    parser.add_argument("--duration", type=float, default=12.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    log_evidences: list[float] = []
    for world in range(options.worlds):
        began = time.monotonic()
        trials = trials_of(ROLES[world % 2], options.seed * 1000 + world // 2 % 3, options.duration)
        scale = float(rng.uniform(1.0, 2.0)) if rng.uniform() < WIDE else 1.0
        recordings = simulate_null_recordings(trials, sample_plant(_wider(trials[0], scale), rng), rng)
        if recordings is None:
            raise SystemExit(f"world {world} diverged; its tolerances are no arm's")
        log_evidences.append(best_log_evidence(recordings, trials, EFFECTS))
        took = time.monotonic() - began
        print(
            f"{world + 1}/{options.worlds} scale {scale:.2f} log evidence {log_evidences[-1]:.1f} nat "
            f"{took:.0f} s"
        )
    result = {
        "worlds": options.worlds,
        "seed": options.seed,
        "duration_s": options.duration,
        "noise": NOISE,
        "gains_nat": log_evidences,
        "quantile": QUANTILE,
        "threshold_nat": threshold(np.array(log_evidences), 0.0),
    }
    write_whole(options.out, json.dumps(result, indent=1) + "\n")
    print(json.dumps({k: v for k, v in result.items() if k != "gains_nat"}))


def _wider(trial: Trial, scale: float) -> Trial:
    """The trial with wider tolerances, for sampling only."""
    wide = trial.recording.arm.tolerances.scaled(scale)
    arm = replace(trial.recording.arm, tolerances=wide)
    return Trial(replace(trial.recording, arm=arm), trial.rigid)


if __name__ == "__main__":
    main()
