"""What the description of a pose recording leaves open: transforms, clocks, zeros and the target's size."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.poses.pose_trial import PoseTrial

UNKNOWN = (0.05, 0.1)  # [m], [rad] around what was solved, of a transform that nobody stated


def tolerance_columns(trial: PoseTrial, widened: float = 1.0) -> list[tuple[Columns, float]]:
    """Regressors (one row each) and standard deviations."""
    return [(trial.columns(twist[None]), std) for twist, std, _ in _opened(trial, widened)]


def unknown_columns(trial: PoseTrial) -> np.ndarray:
    """Which of the tolerance columns belong to transforms that nobody stated, as a mask."""
    return np.array([unknown for *_, unknown in _opened(trial, 1.0)])


def _opened(trial: PoseTrial, widened: float) -> list[tuple[np.ndarray, float, bool]]:
    """Twists (N, 6), standard deviations, and whether what they belong to is unknown."""
    stated, free = trial.recording.tolerances, trial.constants.free
    by = widened * stated.deviation
    half_widths = {
        "camera": (stated.camera_position, stated.camera_rotation),
        "base": (stated.base_position, stated.base_rotation),
        "target": (stated.target_position, stated.target_rotation),
    }
    out: list[tuple[np.ndarray, float, bool]] = []
    for name, twists in trial.links.items():
        unknown = name in free
        position, rotation = UNKNOWN if unknown else (by * w for w in half_widths[name])
        widths = [position] * 3 + [rotation] * 3
        out += [(t, std, unknown) for t, std in zip(twists, widths, strict=True)]
    out.append((trial.size_twist, by * stated.target_size, False))
    for twists in trial.joint_twists.values():
        out += [(t, by * stated.encoder, False) for t in twists]
    if trial.shows_time:
        out += [(rate, by * stated.stamp, False) for rate in trial.rates.values()]
    return [each for each in out if each[1] > 0]
