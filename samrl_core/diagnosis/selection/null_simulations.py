"""How much evidence no effect at all can seem to give: the library run on simulated worlds without one.

Simulations are closed-loop rollouts of the recordings' own commands with nominal parameters sampled from the
tolerances and the recordings' own sensor noise; each goes through the whole screening, since a little
friction moves a joint elsewhere and regressors must follow. The largest log evidence over the library
counts, so that a threshold takes into account how many effects and places are tried. It is cached on disk
per trajectory.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import astuple
from pathlib import Path

import numpy as np
from scipy import signal

from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.common.files import write_whole
from samrl_core.diagnosis.effects.effect import Effect
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.observed import Observed
from samrl_core.diagnosis.residuals.signals.signal_noise import white_noise
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.selection.hypothesis import Evidence
from samrl_core.diagnosis.selection.resimulation import from_start, simulable
from samrl_core.diagnosis.selection.tolerated_plant import sample_plant
from samrl_core.diagnosis.simulation.closed_loop import ClosedLoop
from samrl_core.diagnosis.simulation.loop_model import LoopModel
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters

QUANTILE = 0.98
VERSION = 3  # of what is computed; part of the cache's key


def simulate_null_evidence(
    trials: Sequence[Observed],
    effects: Sequence[Effect],
    count: int,
    seed: int = 0,
    cache: Path | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> np.ndarray | None:
    """Largest log evidence of the library in each null simulation (M,); None where none can be simulated.

    Simulations that were made before, with the same commands, arm and library, come from the cache: an
    interrupted run goes on where it stopped.
    """
    arms = [t for t in trials if simulable(t)]
    if not trials or len(arms) < len(trials):
        return None
    file = None if cache is None else cache / f"{_key(arms, effects, seed)}.json"
    found: list[float] = json.loads(file.read_text())["gains"] if file is not None and file.exists() else []
    for k in range(len(found), count):
        progress(f"simulation {k + 1} of {count} without an effect")
        rng = np.random.default_rng([seed, k])
        recordings = simulate_null_recordings(arms, sample_plant(arms[0], rng), rng)
        found.append(-np.inf if recordings is None else best_log_evidence(recordings, arms, effects))
        if file is not None:
            write_whole(file, json.dumps({"gains": found}))
    made = np.array(found[:count])
    return made[np.isfinite(made)]


def best_log_evidence(
    recordings: Sequence[ArmRecording], trials: Sequence[Trial], effects: Sequence[Effect]
) -> float:
    """Largest log evidence of any effect at any place in recordings made like those of the trials."""
    made = [Trial(r, t.rigid, t.motion.start_s) for r, t in zip(recordings, trials, strict=True)]
    for trial in made:
        trial.share_ranges(made)  # searched as widely as what was recorded
    likelihood = Likelihood(made)
    evidence = Evidence(likelihood, max(2.0, likelihood.correlation_time(likelihood.y)) ** 0.5)
    return max((evidence.fit([h]).log_evidence for h in evidence.screen(effects)), default=0.0)


def simulate_null_recordings(
    trials: Sequence[Trial], plant: PlantParameters, rng: np.random.Generator
) -> list[ArmRecording] | None:
    """The trials' commands by a plant, with their noise; None if it diverges."""
    out = []
    for trial in trials:
        motion, command, arm = trial.motion, trial.motion.drive_input, trial.recording.arm
        controller = arm.controller
        assert command is not None and controller is not None
        shifted = JointSignal(
            command.time - motion.time[0], command.position, command.velocity, None, command.effort
        )
        run = ClosedLoop(LoopModel(arm)).rollout(
            shifted,
            np.median(motion.full_position[:5], axis=0),
            np.median(motion.full_velocity[:5], axis=0),
            [plant],
            float(motion.time[-1] - motion.time[0]),
            record_every=max(1, round(1.0 / (motion.rate * controller.period_s))),
            enabled=from_start(trial.recording.torque_enabled, motion.time[0]),
            keep_diverged=True,
        )
        position, velocity = run.position[0], run.velocity[0]
        if not np.isfinite(position).all():
            return None
        noise = motion.noise
        reading = position + noise.position * rng.standard_normal(position.shape)
        filtered = motion.filtered_velocity
        late = controller.law.of_joints("velocity_lag", trial.joints)
        damped = velocity if filtered is None else low_passed(velocity, late, 1.0 / motion.rate)
        wobble = noise.velocity if filtered is None else white_noise(filtered, motion.rate)
        speed = damped + wobble * rng.standard_normal(velocity.shape)
        # The controller computed from noisy readings; their noise is in the recorded torque as well.
        sent = run.commanded_effort[0] - controller.stiffness * (reading - position)
        sent = sent - controller.damping * (speed - damped)
        effort = None
        if motion.raw_effort is not None:
            effort = run.effort[0] + noise.effort * rng.standard_normal(position.shape)
        # A speed that nobody logs is differenced from positions here as it is there.
        logged = None if motion.raw_velocity is None else speed
        states = JointSignal(run.time, reading, logged, None, effort, None if filtered is None else speed)
        recorded = trial.recording.commanded_effort is not None
        if controller.law.open_loop:
            sent = run.commanded_effort[0]  # what was put in
        commanded = JointSignal(run.time, effort=sent) if recorded else None
        enabled = from_start(trial.recording.torque_enabled, motion.time[0])
        out.append(
            ArmRecording(
                trial.recording.name, "", "", arm, states, shifted, commanded, torque_enabled=enabled
            )
        )
    return out


def low_passed(x: np.ndarray, lag_s: np.ndarray, period_s: float) -> np.ndarray:
    """Samples (F, J) behind a first-order low-pass of time constants (J,) [s], as a simulated law has it."""
    out = np.empty_like(x)
    for j, lag in enumerate(lag_s.tolist()):
        share = period_s / (period_s + lag)
        out[:, j], _ = signal.lfilter([share], [1.0, share - 1.0], x[:, j], zi=(1.0 - share) * x[:1, j])
    return out


def threshold(gains: np.ndarray, least: float) -> float:
    """Gain that no-effect worlds exceed in 2 %: a Gumbel law fitted by moments, at least `least` [nat]."""
    spread = float(np.std(gains)) * np.sqrt(6.0) / np.pi
    location = float(np.mean(gains)) - 0.5772 * spread
    return max(least, location - spread * float(np.log(-np.log(QUANTILE))))


def _key(trials: Sequence[Trial], effects: Sequence[Effect], seed: int) -> str:
    """Of nominal arm, commands, gains and library: what the worlds depend on, noise only roughly."""
    digest = hashlib.sha256(f"{VERSION} {seed}".encode())
    digest.update(" ".join(sorted(e.family for e in effects)).encode())
    for trial in trials:
        arm, command = trial.recording.arm, trial.motion.drive_input
        assert arm.controller is not None and command is not None and command.position is not None
        digest.update((arm.urdf or "").encode())
        digest.update(repr(astuple(arm.tolerances)).encode())
        digest.update(np.round(command.position, 6).tobytes())
        digest.update(arm.controller.stiffness.tobytes() + arm.controller.damping.tobytes())
        if np.any(late := arm.controller.law.of_joints("velocity_lag", trial.joints)):
            digest.update(np.round(late, 4).tobytes())
        if command.effort is not None and arm.controller.law.open_loop:
            digest.update(np.round(command.effort, 6).tobytes())
        digest.update(repr(sorted(arm.controller.stated.items())).encode())
        digest.update(trial.rotor.tobytes() + np.round(np.log2(trial.motion.noise.velocity + 1e-9)).tobytes())
        if arm.tool is not None:
            digest.update(np.float64(arm.tool.mass).tobytes())
    return digest.hexdigest()[:32]
