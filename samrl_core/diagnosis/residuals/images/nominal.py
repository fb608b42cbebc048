"""What the description of an image recording leaves open: calibration, lens, clocks, object and paint."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.images.image_trial import SIZES, ImageTrial
from samrl_core.diagnosis.residuals.images.object_pose import object_spreads

UNKNOWN = ("object",)  # solved from the recordings themselves


def tolerance_columns(trial: ImageTrial, widened: float = 1.0) -> list[tuple[Columns, float]]:
    """Regressors (one row each) and standard deviations."""
    out: list[tuple[Columns, float]] = []
    for name, widths in _opened(trial, widened):
        columns = trial.column(name)
        out += [({key: rows[[k]] for key, rows in columns.items()}, w) for k, w in enumerate(widths)]
    return out


def unknown_columns(trial: ImageTrial) -> np.ndarray:
    """Which of the tolerance columns belong to the object's pose, as a mask."""
    return np.array([name in UNKNOWN for name, widths in _opened(trial, 1.0) for _ in widths])


def _opened(trial: ImageTrial, widened: float) -> list[tuple[str, np.ndarray]]:
    s = trial.recording.tolerances
    by = widened * s.deviation
    six = {
        "hand_eye": (s.camera_position, s.camera_rotation),
        "base": (s.base_position, s.base_rotation),
        "held": (s.held_position, s.held_rotation),
    }
    one = {
        "camera_zeros": s.encoder, "tool_zeros": s.encoder, "camera_late": s.stamp, "tool_late": s.stamp,
        "object_scale": s.object_size, "focal": s.focal, "centre": s.centre, "radial": s.radial,
        "tangential": s.tangential, "depth_scale": s.depth_scale, "depth_offset": s.depth_offset,
        "depth_shift": s.depth_shift, "depth_pattern": s.depth_pattern,
        "outline_object": s.outline, "outline_tip": s.outline, "light": s.brightness,
        "paint_object": s.paint, "paint_static": s.paint, "depth_noise": s.depth_noise,
    }  # fmt: skip
    out = [(name, by * np.repeat(widths, 3)) for name, widths in six.items()]
    out += [(name, np.full(SIZES[name], by * width)) for name, width in one.items()]
    out.append(("object", object_spreads(s)))
    return out
