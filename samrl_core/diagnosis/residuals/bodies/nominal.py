"""What the description of a body, its support and its tracker leaves open."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.residuals.bodies import columns as of
from samrl_core.diagnosis.residuals.bodies.body_trial import DRAG, BodyTrial
from samrl_core.diagnosis.residuals.equations import Columns

UNKNOWN = {"friction": 0.3, "restitution": 0.3}  # around what was solved, of what nobody stated


def tolerance_columns(trial: BodyTrial, widened: float = 1.0) -> list[tuple[Columns, float]]:
    """Regressors (one row each) and standard deviations."""
    return [(columns, std) for columns, std, _ in _opened(trial, widened)]


def unknown_columns(trial: BodyTrial) -> np.ndarray:
    """Which of the tolerance columns belong to coefficients that nobody stated, as a mask."""
    return np.array([unknown for *_, unknown in _opened(trial, 1.0)], dtype=bool)


def _opened(trial: BodyTrial, widened: float) -> list[tuple[Columns, float, bool]]:
    """Columns, standard deviations, and whether what they belong to is unknown.

    The same list for every trial of one body, so nothing depends on which motions one of them holds.
    """
    stated, constants = trial.recording.tolerances, trial.constants
    by = widened * stated.deviation
    out: list[tuple[Columns, float, bool]] = []

    def add(columns: Columns, std: float, unknown: bool = False) -> None:
        rows = len(next(iter(columns.values()))) if columns else 1
        out.extend(({key: v[[k]] for key, v in columns.items()}, std, unknown) for k in range(rows))

    add(of.scale(trial), by * float(np.hypot(stated.length_scale, 2.0 * stated.frame_rate)))
    add(of.frame_tilt(trial), by * stated.tilt)
    add(trial.suspects.get(DRAG, {}), by * stated.air)
    if trial.recording.support is not None:
        # Against gravity, not in the track's frame: how a frame leans shows in no slide, and counted there it
        # would be one tolerance twice.
        add(of.support_tilt(trial), by * stated.tilt)
        unknown = "friction" in constants.free
        size = UNKNOWN["friction"] if unknown else by * stated.friction * max(constants.friction, 0.02)
        add(of.friction(trial), size, unknown)
        unknown = "restitution" in constants.free
        add(of.restitution(trial), UNKNOWN["restitution"] if unknown else by * stated.restitution, unknown)
    if trial.recording.track.turns:
        add(of.center(trial), by * stated.center)
    if "rotation_x" in trial.channels:
        add(of.inertia(trial), by * stated.inertia)
    if trial.recording.support is not None and trial.recording.support.rolls:
        add(of.rolling(trial), by * stated.inertia * trial.recording.body.rolling)
    return [each for each in out if each[1] > 0]
