"""Gears that give, on servos whose log is noisy: their springs hold no noise, and soft ones are found."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.effects.form import Place
from samrl_core.diagnosis.effects.transmission.joint_elasticity import EFFECT as ELASTICITY
from samrl_core.diagnosis.kinds.arms import arm_trials
from samrl_core.diagnosis.residuals.laws.follow_command import span_of_command
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, hypothesis
from tests.diagnosis.controllers.kinds import POSITION_SERVO

STEP_S, EVERY, LIMIT = 2.5e-4, 8, 6.0
LOOP = {
    "type": "position_servo", "stiffness": [30.0], "damping": [1.0], "effort_limit": [LIMIT],
    "velocity_feedforward": [1.0], "period_s": 0.002, "armature": [0.01],
}  # fmt: skip
SWING = Place("joint:swing", (0,))


def servo(stiffness: float, seed: int) -> ArmRecording:
    """A pendulum behind a spring [N m/rad] on a servo that reads its motor with noise.

    Each tick's position is logged with noise of its own, and the torque as sent.
    """
    rng = np.random.default_rng(seed)
    machine = replace(POSITION_SERVO, about=LOOP)
    inertia, weight = machine.inertia + machine.mass * machine.arm**2, 9.81 * machine.mass * machine.arm
    time = np.arange(0.0, 10.0, STEP_S)
    goal = 0.5 * np.sin(1.3 * seed * time) + 0.05 * np.sin(2 * np.pi * (0.5 + 0.2 * time) * time)
    speed = np.gradient(goal, STEP_S)
    heard = 0.05 * rng.normal(size=len(time))
    damping = 0.06 * math.sqrt(stiffness * inertia)
    q, w, motor, turn, u, at, sent = goal[0], speed[0], goal[0], speed[0], 0.0, [], []
    for k, (told, fast) in enumerate(zip(goal.tolist(), speed.tolist(), strict=True)):
        if k % EVERY == 0:
            u = 30.0 * (told - motor) + fast - turn + heard[k]
            at.append(motor)
            sent.append(u)
        spring = stiffness * (motor - q) + damping * (turn - w)
        w += (spring + weight * math.cos(q)) / inertia * STEP_S
        turn += (u - spring) / 0.01 * STEP_S
        q, motor = q + w * STEP_S, motor + turn * STEP_S
    stamps = time[::EVERY]
    logged = np.array(at)[:, None] + 3e-5 * rng.normal(size=(len(at), 1))
    return ArmRecording(
        "swing", "made here", "", machine.described(), JointSignal(stamps, logged),
        JointSignal(stamps, goal[::EVERY, None], speed[::EVERY, None]),
        JointSignal(stamps, effort=np.array(sent)[:, None]),
    )  # fmt: skip


def springs(stiffness: float) -> dict[str, Fit]:
    """The best of each form, by its name."""
    trials, _ = arm_trials([servo(stiffness, seed) for seed in (1, 2)], [])
    likelihood = Likelihood(trials)
    evidence, found = Evidence(likelihood), {}
    for form in ELASTICITY.forms(trials[0], SWING):
        seen = [hypothesis(likelihood, ELASTICITY, form, shape) for shape in form.shapes]
        fits = [evidence.fit([h]) for h in seen if h is not None]
        possible = [fit for fit in fits if np.isfinite(fit.log_evidence)]
        if possible:
            best = max(possible, key=lambda fit: fit.log_evidence)
            found[form.name] = evidence.refine(best, 0)
    return found


def test_a_springs_column_follows_from_the_command() -> None:
    """Machines with nothing wrong had up to 50 of log evidence for a hardening spring: noise, differenced."""
    (trial,), _ = arm_trials([servo(1e4, 1)], [])
    span = span_of_command(trial.motion, 0)
    forms = {form.name: form for form in ELASTICITY.forms(trial, SWING)}
    for name in ("static", "hardening"):
        form = forms[name]
        column = form.columns(trial, form.shapes[0])["dynamics", 0]
        assert (column @ span) @ span.T == pytest.approx(column, abs=1e-9 * float(np.abs(column).max()))
    assert span.shape[1] < 0.15 * len(span)  # so that a tenth of noise is left


def test_a_spring_of_twice_the_effort_limit_is_found() -> None:
    """Small servos have gears as soft as that; 1.5 and 4 times are tried first."""
    fit = springs(2.0 * LIMIT)["swinging"]
    (h,) = fit.hypotheses
    assert fit.log_evidence > 30.0
    assert h.shape["K"] == pytest.approx(2.0 * LIMIT, rel=0.05)
