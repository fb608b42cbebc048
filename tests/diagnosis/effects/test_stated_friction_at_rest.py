"""A slide that sticks: at rest its model's dry friction is anything between its bounds. NumPy alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose, library
from samrl_core.diagnosis.kinds.arms import arm_trials
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.hypothesis import Evidence, hypothesis

URDF = """<robot name="slide"><link name="base"/><link name="table"><inertial><mass value="2"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="slide" type="prismatic"><parent link="base"/><child link="table"/><axis xyz="1 0 0"/>
<limit lower="-1" upper="1" effort="60" velocity="1"/><dynamics friction="5" damping="8"/></joint></robot>"""
MASS, FRICTION, DAMPING = 2.0, 5.0, 8.0
STIFFNESS, BRAKE, STEP_S, SECONDS = 6000.0, 150.0, 0.001, 9.0


def record(seed: int, friction: float = FRICTION, noise: float = 2e-6, urdf: str = URDF) -> ArmRecording:
    """Moves with rests between them; friction stops the table wherever its force allows."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, SECONDS, STEP_S)
    knots = np.repeat(rng.uniform(-0.2, 0.2, 10), 2)[: 2 * 10]
    goal = np.interp(time, np.linspace(0.0, SECONDS, 20), knots)
    goal = np.convolve(np.pad(goal, 100, mode="edge"), np.hanning(201) / 100.0, mode="valid")
    rate = np.gradient(goal, STEP_S)
    q, v = float(goal[0]), 0.0
    at, speed, force = np.empty((3, len(time)))
    for k in range(len(time)):
        at[k], speed[k] = q, v
        force[k] = STIFFNESS * (goal[k] - q) + BRAKE * (rate[k] - v)
        free = v + STEP_S / MASS * (force[k] - DAMPING * v)
        v = free - float(np.clip(free, -friction * STEP_S / MASS, friction * STEP_S / MASS))
        q += STEP_S * v
    some = slice(0, None, 4)
    stamps, shape = time[some], (len(time[some]), 1)
    states = JointSignal(
        stamps,
        at[some, None] + noise * rng.standard_normal(shape),
        speed[some, None] + 0.004 * rng.standard_normal(shape),
    )
    effort = JointSignal(stamps, effort=force[some, None] + 0.1 * rng.standard_normal(shape))
    arm = ArmDescription("tool_arm", ("slide",), urdf, None)
    return ArmRecording(f"run {seed}", f"run{seed}", "", arm, states, None, effort)


def test_a_table_that_sticks_as_its_model_says_has_no_gap() -> None:
    """An unknown cause before: rest was allowed one per cent of the effort limit, whatever is stated."""
    few = DiagnosisSettings(library={"coulomb_friction", "presliding", "friction_asymmetry"})
    found, _ = diagnose([record(1), record(2)], [record(3)], few)
    assert found.verdict == "no_gap", found.reasons


def test_what_holds_a_table_at_rest_does_not_speak_against_its_friction() -> None:
    """A filter that makes the noise of accelerations white raised what is slow, as friction at rest is."""
    little = URDF.replace('friction="5"', 'friction="0.5"')
    made = [record(seed, 4.0, 1.5e-4, little) for seed in (1, 2)]
    trials, _ = arm_trials([replace(r, states=replace(r.states, velocity=None)) for r in made], [])
    likelihood = Likelihood(trials)
    (effect,) = library(["coulomb_friction"])
    form = effect.forms(trials[0], effect.places(trials[0])[0])[0]
    tried = (hypothesis(likelihood, effect, form, shape) for shape in form.shapes)
    evidence = Evidence(likelihood)
    best = max((evidence.fit([h]) for h in tried if h is not None), key=lambda fit: fit.log_evidence)
    left = likelihood.whitened(evidence.remainder(best)) ** 2
    rests = np.concatenate([np.abs(trial.motion.dq[:, 0]) < 0.01 for trial in trials])
    assert rests.mean() > 0.1
    assert np.mean(left[rests]) < 10.0  # 270 before
