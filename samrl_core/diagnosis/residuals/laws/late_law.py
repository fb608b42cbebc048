"""A law whose command comes late, and how well torques explain what a law leaves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from samrl_core.diagnosis.residuals.motion import RecordedMotion


def late_law_change(motion: RecordedMotion, shift: float) -> np.ndarray:
    """Torque (F, J) by which the law asks for more than with its command `shift` [s] later.

    Through the law, as a delay would pass: a pole's torque or a dead band is no straight spring.
    """
    command = motion.command
    assert command is not None
    parts = (command.position, command.velocity, command.effort)
    position, velocity, effort = (None if part is None else motion.delayed(part, shift) for part in parts)
    return motion.law_change(replace(command, position=position, velocity=velocity, effort=effort))


def explained_log_likelihood(left: np.ndarray, columns: Sequence[np.ndarray], least: float = 1e-150) -> float:
    """Log likelihood [nat] of residuals (N,) beside columns (N,) of any size, at the noise level left.

    `least` is a deviation that no log of numbers falls below.
    """
    matrix = np.stack(columns, axis=1)
    matrix = matrix / np.maximum(np.sqrt(np.mean(matrix**2, axis=0)), 1e-300)
    rest = left - matrix @ np.linalg.lstsq(matrix, left, rcond=1e-9)[0]
    return -0.5 * len(rest) * float(np.log(np.mean(rest**2) + least**2))
