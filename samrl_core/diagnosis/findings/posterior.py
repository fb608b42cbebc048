"""What was named as a correction of the model: fields, posterior samples, the motion it was seen in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from samrl_core.cell.robots.joint_dynamics import joint_dynamics
from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.cell.types.drive_law import DriveLaw
from samrl_core.diagnosis.export.correction import BODY, Correction, NominalLaw
from samrl_core.diagnosis.residuals.trial import Trial, as_arms
from samrl_core.diagnosis.result import HeldOutGap
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit
from samrl_core.diagnosis.selection.resimulation import Resimulation, plant_of
from samrl_core.diagnosis.selection.shape_posterior import root_of, shape_posterior
from samrl_core.diagnosis.simulation.plant_arrays import ten_to_frame
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters
from samrl_core.diagnosis.verdict.confidence import formula_deviation

SAMPLES = 200
MOST_MOTION = 4000  # samples of the fitted motion that are kept


def correction_of(
    evidence: Evidence,
    fit: Fit,
    runs: Sequence[Resimulation],
    gap: HeldOutGap | None,
    rng: np.random.Generator,
) -> Correction:
    """The correction that a fit makes of its arm's model."""
    trials = as_arms(evidence.likelihood.trials)
    trial = trials[0]
    arm = trial.recording.arm
    stated = joint_dynamics(arm)
    effects = tuple(h.name for h in fit.hypotheses)
    plant = plant_of(trial, fit)
    unsimulated = tuple(
        h.name
        for h, a in zip(fit.hypotheses, fit.amplitudes, strict=True)
        if h.form.plant_fields(trial, h.shape, a) is None
    )
    changed = {} if plant is None else _changed(trial, plant)
    samples: list[dict[str, np.ndarray]] = []
    if plant is not None:
        samples = [_changed(trial, p) for p in _sampled_plants(evidence, fit, trial, rng)]
    return Correction(
        effects, arm.joints, changed, unsimulated, arm.urdf or "", stated.friction, stated.damping,
        stated.armature, _law(arm, trial), _tool(arm),
        {"shrink": None if gap is None else gap.shrink, "ci95": None if gap is None else gap.ci95,
         "metric": None if gap is None else gap.metric},
        samples={
            name: np.array([s.get(name, np.broadcast_to(_neutral(name), value.shape)) for s in samples])
            for name, value in changed.items()
            if samples
        },
        motion=_motion(trials),
        held_out=tuple(_held_out(run) for run in runs),
    )  # fmt: skip


def _neutral(name: str) -> Any:
    value = getattr(PlantParameters(), name)
    return 0.0 if value is None else value


def _changed(trial: Trial, plant: PlantParameters) -> dict[str, np.ndarray]:
    """Fields that are not neutral; a payload at the flange becomes part of the last joint's body."""
    neutral, out = PlantParameters(), {}
    for f in fields(PlantParameters):
        value = getattr(plant, f.name)
        if value is None or isinstance(value, str) or f.name in ("seed", "payload"):
            continue
        default = getattr(neutral, f.name)
        if default is not None and np.all(np.asarray(value) == default):
            continue
        shape = (trial.joints,) if f.metadata.get("kind") == "joint" else np.shape(value)
        out[f.name] = np.broadcast_to(np.asarray(value, dtype=float), shape).copy()
    if plant.payload is not None:
        assert trial.rigid is not None
        flange = trial.rigid.flange_in_joint
        body = out.get(BODY, np.zeros((trial.joints, 10)))
        body[-1] = body[-1] + ten_to_frame(flange.rotation, flange.translation) @ plant.payload
        out[BODY] = body
    return out


def _sampled_plants(
    evidence: Evidence, fit: Fit, trial: Trial, rng: np.random.Generator
) -> list[PlantParameters]:
    """Plants of posterior samples: amplitudes together, shapes, what another formula would make of them."""
    root = root_of(fit.covariance)
    loose = [formula_deviation(evidence, fit, i) for i in range(len(fit.hypotheses))]
    shapes = [shape_posterior(evidence, fit, i) for i in range(len(fit.hypotheses))]
    out = []
    for _ in range(SAMPLES):
        step, start = root @ rng.standard_normal(len(root)), 0
        hypotheses, amplitudes = [], []
        for h, a, formula, of in zip(fit.hypotheses, fit.amplitudes, loose, shapes, strict=True):
            shape, follow, _ = of.vary(rng, formula)
            moved = (a + follow + step[start : start + len(a)]) * (1.0 + formula * rng.standard_normal())
            start += len(a)
            hypotheses.append(replace(h, shape=shape))
            amplitudes.append(moved)
        plant = plant_of(trial, replace(fit, hypotheses=tuple(hypotheses), amplitudes=tuple(amplitudes)))
        if plant is not None:
            out.append(plant)
    return out


def _law(arm: ArmDescription, trial: Trial) -> NominalLaw | None:
    control = arm.controller
    if control is None or not _is_plain(control.law):
        return None
    assert trial.rigid is not None
    limit = trial.rigid.effort_limits() if control.effort_limit is None else control.effort_limit
    return NominalLaw(
        tuple(map(float, control.stiffness)), tuple(map(float, control.damping)), tuple(map(float, limit)),
        float(control.period_s), bool(control.gravity_compensation), control.gravity,
    )  # fmt: skip


def _is_plain(law: DriveLaw) -> bool:
    """Whether a law is stiffness and damping alone: what the scripts of an export have."""
    plain = DriveLaw()
    told = (
        "velocity_share",
        "velocity_lag",
        "torque_per_volt",
        "torque_per_ampere",
        "most_volt",
    )  # no matter, or written out
    names = [f.name for f in fields(DriveLaw) if f.name not in told]
    return all(np.all(np.asarray(getattr(law, name)) == getattr(plain, name)) for name in names)


def _tool(arm: ArmDescription) -> dict[str, Any] | None:
    if arm.tool is None:
        return None
    return {
        "mass": float(arm.tool.mass),
        "center_of_mass": np.asarray(arm.tool.center_of_mass, dtype=float).tolist(),
        "inertia": np.asarray(arm.tool.inertia, dtype=float).tolist(),
    }


def _motion(trials: Sequence[Trial]) -> dict[str, np.ndarray]:
    """Of the fitted recordings, band-limited."""
    if trials[0].rigid is None or not trials[0].motion.dynamic:
        return {}
    every = max(1, sum(len(t) for t in trials) // MOST_MOTION)
    parts = {
        "time": [t.motion.session for t in trials],
        "position": [t.motion.q for t in trials],
        "velocity": [t.motion.dq for t in trials],
        "torque": [t.transmitted for t in trials],
    }
    return {name: np.concatenate(part)[::every] for name, part in parts.items()}


def _held_out(run: Resimulation) -> dict[str, np.ndarray]:
    motion = run.trial.motion
    command = motion.drive_input  # of a motor without a loop: what it was given
    assert command is not None and command.position is not None
    zero, control = np.zeros_like(command.position), run.trial.recording.arm.controller
    assert control is not None
    share = control.law.of_joints("velocity_share", run.trial.joints)
    out = {
        "stiffness": np.asarray(control.stiffness, dtype=float),
        "damping": np.asarray(control.damping, dtype=float),
        "velocity_lag": control.law.of_joints("velocity_lag", run.trial.joints),
        "time": run.time,
        "start_position": np.median(motion.full_position[:5], axis=0),
        "start_velocity": np.median(motion.full_velocity[:5], axis=0),
        "command_time": command.time - motion.time[0],
        "command_position": command.position,
        "command_velocity": zero if command.velocity is None else command.velocity * share,
        "command_effort": zero if command.effort is None else command.effort,
    }
    for quantity, values in run.measured.items():
        out[f"measured_{quantity}"] = values
        out[f"scale_{quantity}"] = np.broadcast_to(run.scales[quantity], values.shape[1:]).copy()
        for plant in ("nominal", "with_effect"):
            if plant in run.simulated:
                out[f"{plant}_{quantity}"] = run.simulated[plant][quantity]
    return out
