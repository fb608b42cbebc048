"""Noise that a law multiplies: in what the log reads, and in what the drive reads and nobody logs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.effects.drive.controller_gain import EFFECT as CONTROLLER_GAIN
from samrl_core.diagnosis.effects.form import Place
from samrl_core.diagnosis.kinds.arms import arm_trials
from samrl_core.diagnosis.residuals.laws.follow_command import (
    part_that_follows,
    reads_what_is_logged,
    sure_part,
)
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, hypothesis
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from tests.diagnosis.controllers.kinds import POSITION_SERVO

STIFFNESS, DAMPING, RATE, STEP_S = 30.0, 1.0, 500.0, 0.001
LOOP = {
    "type": "position_servo", "stiffness": [STIFFNESS], "damping": [DAMPING], "effort_limit": [50.0],
    "velocity_feedforward": [1.0], "period_s": STEP_S,
}  # fmt: skip
SWING = Place("joint:swing", (0,))


def servo(scale: float, noise: float, seed: int, slow: float, step: float = 3e-5) -> ArmRecording:
    """A pendulum on a servo of `scale` times its gains, that reads its speed with noise [rad/s].

    Logged are positions, rounded to steps [rad], and the torque as sent.
    """
    rng = np.random.default_rng(seed)
    machine = replace(POSITION_SERVO, about=LOOP, rotor=0.0)
    inertia, weight = machine.inertia + machine.mass * machine.arm**2, 9.81 * machine.mass * machine.arm
    time = np.arange(0.0, 10.0, STEP_S)
    goal = 0.6 * np.sin(slow * time) + 0.2 * np.sin(2.7 * slow * time + 1.0)
    speed = np.gradient(goal, STEP_S)
    read = noise * rng.normal(size=len(time))
    q, w, at, sent = goal[0], speed[0], [], []
    for told, fast, wrong in zip(goal.tolist(), speed.tolist(), read.tolist(), strict=True):
        u = scale * (STIFFNESS * (told - q) + DAMPING * (fast - w + wrong))
        at.append(q)
        sent.append(u)
        w += (u + weight * np.cos(q)) / inertia * STEP_S
        q += w * STEP_S
    every = round(1.0 / (RATE * STEP_S))
    stamps, place, torque = (np.array(x)[::every] for x in (time, at, sent))
    logged = np.round(place[:, None] / step) * step
    command = JointSignal(stamps, goal[::every, None], speed[::every, None])
    effort = JointSignal(stamps, effort=torque[:, None])
    states = JointSignal(stamps, logged)
    return ArmRecording("swing", "made here", "", machine.described(), states, command, effort)


def gains(scale: float, noise: float, step: float) -> Fit:
    """Both gains fitted to two motions of such a machine."""
    trials, _ = arm_trials([servo(scale, noise, seed, 1.5 * seed, step) for seed in (1, 2)], [])
    likelihood = Likelihood(trials)
    form = CONTROLLER_GAIN.forms(trials[0], SWING)[0]
    found = hypothesis(likelihood, CONTROLLER_GAIN, form, {})
    assert found is not None
    return Evidence(likelihood).fit([found])


@pytest.mark.parametrize("step", [3e-5, 1e-3])
def test_speed_noise_of_the_drive_is_no_weaker_law(step: float) -> None:
    """It is in the torque and shakes the machine, so that the law at the measured states follows it."""
    fit = gains(1.0, 0.3, step)
    assert fit.log_evidence < 3.0
    assert np.abs(fit.amplitudes[0]).max() < 0.1


def test_weaker_gains_are_found_beside_such_noise() -> None:
    fit = gains(0.8, 0.3, 3e-5)
    assert fit.log_evidence > 100.0
    assert fit.amplitudes[0] == pytest.approx([-0.2, -0.2], abs=0.05)


def test_noise_that_the_torque_holds_too_is_no_error() -> None:
    """Logged speeds with the noise that the drive read: the law is exact, and so are its terms."""
    recording = servo(1.0, 0.0, 1, 1.5)
    rng = np.random.default_rng(1)
    states, command = recording.states, recording.command
    assert command is not None and command.position is not None and command.velocity is not None
    assert states.position is not None
    velocity = np.gradient(states.position, states.time, axis=0) + 0.05 * rng.normal(
        size=states.position.shape
    )
    u = STIFFNESS * (command.position - states.position) + DAMPING * (command.velocity - velocity)
    whole = replace(
        recording,
        states=replace(states, velocity=velocity),
        commanded_effort=JointSignal(states.time, effort=u),
    )
    assert reads_what_is_logged(Trial(whole, RigidArm(whole.arm)).motion).all()
    assert not reads_what_is_logged(Trial(recording, RigidArm(recording.arm)).motion).any()


def test_what_follows_the_command_holds_no_noise() -> None:
    """All of a loop's answer stays, a twentieth of noise's variance: so many signals explain by chance."""
    motion = Trial(servo(1.0, 0.0, 1, 1.5), RigidArm(POSITION_SERVO.described())).motion
    term = motion.described_law.spring
    noise = np.random.default_rng(2).normal(size=(len(motion.time), 1))
    kept, heard = (motion.reduce(x) for x in part_that_follows(motion, np.stack([term, noise])))
    assert np.var(kept - motion.reduce(term)) < 1e-3 * np.var(motion.reduce(term))
    assert np.var(heard) < 0.1 * np.var(motion.reduce(noise))


@pytest.mark.parametrize(("noise", "whole"), [(1e-4, True), (0.3, False)])
def test_a_term_with_little_noise_is_taken_whole(noise: float, whole: bool) -> None:
    """What friction makes of a term follows from no command: left out, a gain of -13 % was -8.2 +- 2.7 %."""
    motion = Trial(servo(1.0, noise, 1, 1.5, 1e-6), RigidArm(POSITION_SERVO.described())).motion
    assert not reads_what_is_logged(motion).any()
    spring = motion.described_law.spring[None]
    assert np.array_equal(sure_part(motion, spring), spring) == whole
    assert np.array_equal(sure_part(motion, spring), part_that_follows(motion, spring)) != whole
