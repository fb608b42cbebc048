"""Springs that rub or harden, and cables that are slack: forms that no plant simulates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.diagnose import library
from samrl_core.diagnosis.effects.load.cable import SlackCable
from samrl_core.diagnosis.effects.transmission.joint_elasticity import hardened
from samrl_core.diagnosis.residuals.basis_functions import rubbing_spring
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.trial import Trial, as_arms
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, hypothesis
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from tests.diagnosis import worlds
from tests.diagnosis.cases import find_form
from tests.diagnosis.worlds import BEND, LIFT


def nominal(programmes: str = "AB") -> list[ArmRecording]:
    return worlds.record(worlds.plant(), programmes, np.random.default_rng(5))


def more_torque(recording: ArmRecording, joint: int, torque: np.ndarray) -> ArmRecording:
    """The same motion, for which a joint's drive must give more."""
    states, commanded = recording.states, recording.commanded_effort
    assert states.effort is not None and commanded is not None and commanded.effort is not None
    extra = np.zeros_like(states.effort)
    extra[:, joint] = torque
    return replace(
        recording,
        states=replace(states, effort=states.effort + extra),
        commanded_effort=JointSignal(commanded.time, effort=commanded.effort + extra),
    )


def best(recordings: list[ArmRecording], family: str, place: str, form_name: str) -> tuple[Fit, Trial]:
    likelihood = Likelihood(worlds.trials(recordings))
    evidence, trial = Evidence(likelihood), as_arms(likelihood.trials)[0]
    (effect,) = library([family])
    form = find_form(effect, trial, place, form_name)
    tried = [hypothesis(likelihood, effect, form, shape) for shape in form.shapes]
    fits = [evidence.fit([h]) for h in tried if h is not None]
    fit = evidence.refine(max(fits, key=lambda f: f.log_evidence), 0, 60)
    return fit, trial  # of evidence minus infinity, where the form is not admitted at all


def found(fit: Fit, trial: Trial) -> dict[str, float]:
    h = fit.hypotheses[0]
    return h.form.parameters(trial, h.shape, fit.amplitudes[0])


def test_a_hardening_spring_holds_its_torque() -> None:
    torque = np.linspace(-30.0, 30.0, 61)
    twist = hardened(torque, 8.0)
    assert twist * (1 + (twist / 8.0) ** 2) == pytest.approx(torque)
    assert hardened(torque, 1e6) == pytest.approx(torque)


def test_a_rubbing_spring_takes_energy_and_is_stiff_after_a_turn() -> None:
    wave = 10.0 * np.sin(np.linspace(0, 6 * np.pi, 3001))
    twist = rubbing_spring(wave, 2.0, 0.5)
    last = slice(1000, 3001)  # two whole turns, after the first that is not closed
    assert np.sum(0.5 * (wave[last][1:] + wave[last][:-1]) * np.diff(twist[last])) > 0
    up = np.interp(0.0, wave[1750:2250], twist[1750:2250])
    down = np.interp(0.0, -wave[1250:1750], twist[1250:1750])
    assert down - up == pytest.approx(4.0, rel=0.05)  # twice the level, once K x
    turn = int(np.argmax(wave))
    slope = (wave[turn + 60] - wave[turn]) / (twist[turn + 60] - twist[turn])
    assert slope > 4.0  # of the spring alone it is one; 1 + 2 * 2.0 / 0.5 at the very turn
    assert rubbing_spring(wave, 1e-9, 0.5) == pytest.approx(wave, abs=1e-6)


def test_a_slack_cable_is_measured() -> None:
    k, harder, slack, rest, height = 1.4, 3.0, 0.12, 0.6, 0.15
    out = []
    for recording in nominal():
        q = np.asarray(recording.states.position)[:, BEND]
        away = q - rest
        taut = np.sign(away) * np.maximum(np.abs(away) - slack, 0.0)
        z = np.zeros(len(q))
        for i in range(1, len(q)):
            step = q[i] - q[i - 1]
            z[i] = z[i - 1] + step / 0.04 - abs(step) / 0.04 * z[i - 1]
        out.append(more_torque(recording, BEND, k * taut + harder * taut * np.abs(taut) + height * z))
    fit, trial = best(out, "cable", "joint:bend", "slack")
    assert np.isfinite(fit.log_evidence)
    values = found(fit, trial)
    assert values["q0"] == pytest.approx(rest, abs=0.05)
    assert values["h"] == pytest.approx(height, rel=0.15)
    # stiffness, hardening and slack make up for one another; what they pull together does not
    h = fit.hypotheses[0]
    assert isinstance(h.form, SlackCable) and h.form.joint == BEND
    got = fit.amplitudes[0][:2] @ h.form.pull(trial, h.shape)
    away = trial.motion.q[:, BEND] - rest
    taut = np.sign(away) * np.maximum(np.abs(away) - slack, 0.0)
    true = k * taut + harder * taut * np.abs(taut)
    assert np.std(got - true) < 0.1 * np.std(true)


def test_a_rubbing_spring_is_measured() -> None:
    """The arm's torque is that of a link that lags its reading; none of it is made from the regressors."""
    stiffness, level, distance = 6000.0, 3.0, 2e-4
    out = []
    for recording in nominal():
        (trial,) = worlds.trials([recording])
        motion, rigid = trial.motion, RigidArm(recording.arm)
        torque = motion.smooth(np.asarray(recording.states.effort))[:, LIFT]
        twist, z, x = np.zeros(len(torque)), 0.0, torque[0] / stiffness
        for i in range(1, len(torque)):
            for _ in range(20):  # Newton steps for the balance of spring and slider within this sample
                step = x - twist[i - 1] if i > 1 else 0.0
                side = np.sign(step)
                slid = side + (z - side) * np.exp(-abs(step) / distance)
                slope = stiffness + level / distance * np.exp(-abs(step) / distance) * (1.0 - side * z)
                change = (stiffness * x + level * slid - torque[i]) / slope
                x -= change
                if abs(change) < 1e-9:
                    break
            step = x - twist[i - 1] if i > 1 else 0.0
            side = np.sign(step)
            z, twist[i] = side + (z - side) * np.exp(-abs(step) / distance), x
        twist[0] = twist[1]
        lag = np.zeros_like(motion.full_position)
        lag[:, LIFT] = motion.smooth(twist[:, None])[:, 0]
        rate = np.gradient(lag, 1.0 / motion.rate, axis=0)
        q, dq, ddq = motion.full_position, motion.full_velocity, motion.full_acceleration
        moved = rigid.inverse_dynamics(q - lag, dq - rate, ddq - np.gradient(rate, 1.0 / motion.rate, axis=0))
        extra = moved - rigid.inverse_dynamics(q, dq, ddq)
        for j in range(3):
            recording = more_torque(recording, j, extra[:, j])
        out.append(recording)
    fit, trial = best(out, "transmission_hysteresis", "joint:lift", "spring")
    assert np.isfinite(fit.log_evidence)
    values = found(fit, trial)
    # Spring and slider trade against each other along a ridge of the evidence, and the truth is on it.
    h = fit.hypotheses[0]
    true = hypothesis(
        Likelihood(worlds.trials(out)), h.effect, h.form, {"ts": level, "y": distance * stiffness}
    )
    assert true is not None
    at_truth = Evidence(Likelihood(worlds.trials(out))).fit([true])
    assert at_truth.log_evidence > fit.log_evidence - 5.0
    assert found(at_truth, trial)["K"] == pytest.approx(stiffness, rel=0.1)
    assert values["a"] == pytest.approx(level / stiffness, rel=0.3)
    plain = best(out, "joint_elasticity", "joint:lift", "static")[0]
    assert fit.log_evidence > plain.log_evidence + 20


def test_an_eccentricity_that_hardly_varies_is_an_offset() -> None:
    trial = worlds.trials(nominal("A"))[0]
    (effect,) = library(["encoder_eccentricity"])
    top = np.pi / 2 - float(np.mean(trial.motion.q[:, LIFT]))  # the wave's crest in the middle of the travel
    for k, turn, possible in ((0.3, 0.0, False), (8.0, 0.0, True)):
        amplitudes = 0.01 * np.array([np.cos(top + turn), np.sin(top + turn)])
        form = find_form(effect, trial, "joint:lift", "")
        assert form.is_admissible(trial, {"k": k}, amplitudes) is possible


def test_second_derivatives_keep_their_size_up_to_the_band() -> None:
    motion = worlds.trials(nominal("A"))[0].motion
    w = 2 * np.pi * 0.98 * motion.band
    wave = np.sin(w * motion.t)
    inner = slice(50, -50)
    assert motion.second_derivative(wave)[inner] == pytest.approx(-(w**2) * wave[inner], abs=0.02 * w**2)
