"""How much evidence no effect at all can seem to give: the library run on simulated worlds without one.

Worlds are closed-loop rollouts of the recordings' own commands with nominal parameters drawn from the
tolerances and the recordings' own sensor noise. The largest gain over the whole library in each is kept, so
that the threshold takes into account how many effects and places are tried. Kept on disk per trajectory:
recordings of the same commands by the same nominal arm need no new rollouts.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Sequence
from dataclasses import astuple
from pathlib import Path

import numpy as np

from samrl_core.diagnosis.equations import form_equations
from samrl_core.diagnosis.hypothesis import Hypothesis
from samrl_core.diagnosis.likelihood import Likelihood
from samrl_core.diagnosis.motion import Motion
from samrl_core.diagnosis.resimulation import simulable
from samrl_core.diagnosis.trial import Trial
from samrl_core.dynamics.closed_loop import ClosedLoop
from samrl_core.dynamics.plant_parameters import PlantParameters
from samrl_core.types.arm_recording import ArmRecording, JointSignal

WORLDS = 24
QUANTILE = 0.98
CORRELATION = 2.0  # of the noise, band-limited and decimated
VERSION = 1  # of what is computed; part of the cache's key


def null_gains(
    likelihood: Likelihood, pool: Sequence[Hypothesis], seed: int = 0, cache: Path | None = None
) -> np.ndarray | None:
    """Largest log evidence of the pool in each simulated world (M,); None where none can be simulated."""
    if not likelihood.trials or not all(simulable(t) for t in likelihood.trials):
        return None
    file = None if cache is None else cache / f"{_key(likelihood, pool, seed)}.json"
    if file is not None and file.exists():
        return np.array(json.loads(file.read_text())["gains"])
    responses = _responses(likelihood, np.random.default_rng(seed))
    gains = np.full(responses.shape[1], -np.inf)
    for h in pool:
        gains = np.maximum(gains, _gains(likelihood, h, responses))
    if file is not None:
        file.parent.mkdir(parents=True, exist_ok=True)
        temporary = file.with_suffix(f".{os.getpid()}")
        temporary.write_text(json.dumps({"gains": gains.tolist()}))
        temporary.replace(file)
    return gains


def threshold(gains: np.ndarray, least: float) -> float:
    """Gain that no-effect worlds exceed in 2 %: a Gumbel law fitted by moments, at least `least` [nat]."""
    spread = float(np.std(gains)) * np.sqrt(6.0) / np.pi
    location = float(np.mean(gains)) - 0.5772 * spread
    return max(least, location - spread * float(np.log(-np.log(QUANTILE))))


def draw_plant(trial: Trial, rng: np.random.Generator) -> PlantParameters:
    """A nominal arm within its tolerances, uniformly."""
    rigid, arm = trial.rigid, trial.recording.arm
    assert rigid is not None
    tolerances, joints = arm.tolerances, trial.joints

    def within(values: float | tuple[float, ...], unit: np.ndarray | float) -> np.ndarray:
        return np.asarray(values) * unit * rng.uniform(-1, 1, size=joints)

    delta = np.zeros((joints, 10))
    for link, p in enumerate(rigid.inertial_parameters):
        mass = max(float(p[0]), 1e-6)
        delta[link] = p * tolerances.mass * rng.uniform(-1, 1)
        delta[link, 1:4] += mass * tolerances.center_of_mass * rng.uniform(-1, 1, size=3)
        # Along the nominal inertia, so that it stays one that a body can have.
        delta[link, 4:] += p[4:] * tolerances.inertia * rng.uniform(-1, 1)
    scale = trial.scale
    speed = np.where(np.isfinite(rigid.velocity_limits()), rigid.velocity_limits(), 1.0)
    tilt = tolerances.base_tilt * rng.uniform(-1, 1, size=2)
    gravity = rigid.gravity_vector
    return PlantParameters(
        inertial_delta=delta,
        torque_offset=within(tolerances.torque_offset, scale),
        sensor_bias=within(tolerances.torque_offset, scale),
        coulomb=np.abs(within(tolerances.coulomb_friction, scale)),
        viscous=np.abs(within(tolerances.viscous_friction, scale / speed)),
        rotor_inertia=within(tolerances.armature, trial.rotor),
        gravity=gravity - np.cross(np.array([tilt[0], tilt[1], 0.0]), gravity),
    )


def _responses(likelihood: Likelihood, rng: np.random.Generator) -> np.ndarray:
    """Residuals (N, M) of the worlds in units of the recordings' noise; a diverged world is left out."""
    plants = [draw_plant(likelihood.trials[0], rng) for _ in range(WORLDS)]
    out = np.zeros((len(likelihood.y), WORLDS))
    good = np.ones(WORLDS, dtype=bool)
    for r, trial in enumerate(likelihood.trials):
        motion, command = trial.motion, trial.motion.command
        controller = trial.recording.arm.controller
        assert command is not None and controller is not None
        every = max(1, round(1.0 / (motion.rate * controller.period_s)))
        shifted = JointSignal(
            command.time - motion.time[0], command.position, command.velocity, None, command.effort
        )
        rollouts = ClosedLoop(trial.recording.arm).rollout(
            shifted,
            np.median(motion.full_position[:5], axis=0),
            np.median(motion.full_velocity[:5], axis=0),
            plants,
            float(motion.time[-1] - motion.time[0]),
            record_every=every,
            keep_diverged=True,
        )
        noise = motion.noise
        for m in range(WORLDS):
            if not np.isfinite(rollouts.position[m]).all():
                good[m] = False
                continue

            def noisy(values: np.ndarray, level: np.ndarray) -> np.ndarray:
                return values + level * rng.standard_normal(values.shape)

            # The controller computed from noisy readings; its noise is in the recorded torque as well.
            reading = noisy(rollouts.position[m], noise.position)
            speed = noisy(rollouts.velocity[m], noise.velocity)
            sent = rollouts.commanded_effort[m] - controller.stiffness * (reading - rollouts.position[m])
            sent = sent - controller.damping * (speed - rollouts.velocity[m])
            effort = noisy(rollouts.effort[m], noise.effort) if motion.raw_effort is not None else None
            recording = ArmRecording(
                "null", "", "", trial.recording.arm,
                JointSignal(rollouts.time, reading, speed, None, effort), shifted,
                JointSignal(rollouts.time, effort=sent) if motion.raw_commanded is not None else None,
            )  # fmt: skip
            equations = form_equations(Motion(recording, trial.rigid, motion.start_s))
            for channel in trial.channels:
                ratio = (
                    equations.residual[channel][: len(trial)]
                    / trial.equations.sigma[channel][: len(equations.residual[channel])]
                )
                for j in range(trial.joints):
                    part = likelihood.blocks[r, channel, j]
                    out[part.start : part.start + len(ratio), m] = ratio[:, j]
    return out[:, good]


def _gains(likelihood: Likelihood, h: Hypothesis, responses: np.ndarray) -> np.ndarray:
    """Log evidence (M,) of one hypothesis in each world."""
    gram = likelihood.tempered_gram(h.regressors, h.regressors, CORRELATION)
    moment = likelihood.tempered_moments(h.regressors, responses, CORRELATION)
    scaled = h.spread[:, None] * gram * h.spread + np.eye(len(h.mean))
    rest = h.spread[:, None] * (moment - (gram @ h.mean)[:, None])
    _, log_determinant = np.linalg.slogdet(scaled)
    fixed = h.mean @ moment - 0.5 * h.mean @ gram @ h.mean
    quadratic = np.sum(rest * np.linalg.solve(scaled, rest), axis=0)
    return fixed + 0.5 * quadratic - 0.5 * log_determinant - np.log(h.tried)


def _key(likelihood: Likelihood, pool: Sequence[Hypothesis], seed: int) -> str:
    """Of nominal arm, commands and library: what the simulated worlds depend on, noise aside."""
    digest = hashlib.sha256(f"{VERSION} {WORLDS} {seed}".encode())
    digest.update(" ".join(sorted({h.name + h.form.name for h in pool})).encode())
    for trial in likelihood.trials:
        arm, command = trial.recording.arm, trial.recording.command
        assert arm.controller is not None and command is not None and command.position is not None
        digest.update((arm.urdf or "").encode())
        digest.update(repr(astuple(arm.tolerances)).encode())
        digest.update(np.round(command.position, 6).tobytes())
        digest.update(arm.controller.stiffness.tobytes() + arm.controller.damping.tobytes())
        digest.update(trial.rotor.tobytes() + np.round(np.log2(trial.motion.noise.velocity + 1e-9)).tobytes())
        if arm.tool is not None:
            digest.update(np.float64(arm.tool.mass).tobytes())
    return digest.hexdigest()[:32]
