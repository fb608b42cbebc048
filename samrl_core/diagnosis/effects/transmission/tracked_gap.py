"""Backlash as a servo's tracking error shows it, where no torque model exists: at one joint, or at all."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Shape
from samrl_core.diagnosis.residuals.basis_functions import play
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial

GAP = 0.01  # [rad] of the play along a command; its own width is the amplitude
SPREAD = 0.01  # [rad] of the prior
LEAST_OF_ALL = 0.003  # [rad] at each joint, where all are said to have a gap


def forms(trial: Trial) -> tuple[Form, ...]:
    """By the side of the load where one was recorded, else by the way the command came."""
    if trial.motion.u is None and trial.motion.tau is None:
        return (Form("direction", ("b",)),)
    return (Form("load", ("b",), tuple({"t0": f} for f in (0.1, 0.3, 1.0))),)


def columns(trial: Trial, joints: tuple[int, ...], form: str, shape: Shape) -> Columns:
    """Tracking error of gaps of half width one; a row for each joint."""
    out: Columns = {}
    for i, j in enumerate(joints):
        rows = np.zeros((len(joints), len(trial)))
        rows[i] = _by_load(trial, j, shape["t0"]) if form == "load" else _by_direction(trial, j)
        out |= trial.tracking(j, rows)
    return out


def prior(joints: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Centred on no gap."""
    return np.zeros(len(joints)), np.full(len(joints), SPREAD)


def admissible(form: str, amplitudes: np.ndarray) -> bool:
    """Gaps are positive; those of all joints beyond what servos let stand."""
    # The sign of a load register is a convention of the drive.
    sizes = np.abs(amplitudes) if form == "load" else amplitudes
    return bool(np.all(sizes > (LEAST_OF_ALL if len(sizes) > 1 else 0.0)))


def physical(trial: Trial, joints: tuple[int, ...], amplitudes: np.ndarray) -> dict[str, float]:
    """Half widths; of an arm with the joint's name in brackets."""
    if len(joints) == 1:
        return {"b": float(abs(amplitudes[0]))}
    names = trial.recording.arm.joints
    return {f"b[{names[j]}]": float(abs(a)) for j, a in zip(joints, amplitudes, strict=True)}


def _by_load(trial: Trial, joint: int, turn: float) -> np.ndarray:
    """Side of the load (N,), -1..1 over its usual span; `turn` is the share of it in which it changes."""
    load = trial.motion.tau if trial.motion.tau is not None else trial.motion.u
    assert load is not None
    still = trial.settled[:, joint] > 0.5  # moves need more than loads
    low, high = np.quantile(load[still, joint] if np.any(still) else load[:, joint], [0.05, 0.95])
    side = (load[:, joint] - 0.5 * (high + low)) / (0.5 * (high - low) + 1e-12)
    return np.tanh(side / turn) / np.tanh(1.0 / turn)


def _by_direction(trial: Trial, joint: int) -> np.ndarray:
    command = trial.motion.command
    assert command is not None and command.position is not None
    path = trial.motion.reduce(command.position)[:, joint]
    return (path - play(path, GAP)) / GAP
