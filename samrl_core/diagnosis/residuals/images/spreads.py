"""Names of the columns of images, how many each has, and how far each may be off in a good installation."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.types.image_recording import ImageTolerances
from samrl_core.diagnosis.residuals.images.bends import BENDS
from samrl_core.diagnosis.residuals.images.colors import COLORS, TINTS
from samrl_core.diagnosis.residuals.images.rows import OF_CHANNEL, TILES

PLACE, TURN = 0.05, 0.4  # of the object, [m] in the table's plane, [rad] about its normal: nobody states them
SIZES = {  # how many columns each name has
    "hand_eye": 6, "base": 6, "camera_zeros": 7, "camera_late": 1, "tool_zeros": 7, "tool_late": 1, "held": 6,
    "object": 6, "object_scale": 1, "focal": 2, "centre": 2, "radial": 2, "tangential": 2,
    **{name: 1 for names in OF_CHANNEL.values() for name in names},
    "depth_shift": 2, "depth_bend": BENDS, "depth_pattern": 2 * TILES**2, "outline_bend": BENDS,
    "tint": len(TINTS), "paint_object": COLORS, "paint_static": COLORS, "white_object": COLORS,
    "white_static": COLORS,
}  # fmt: skip


def object_spreads(stated: ImageTolerances) -> np.ndarray:
    """Standard deviations (6,) of the object's pose around where the task puts it."""
    by = stated.deviation
    tilt = by * stated.object_tilt
    return np.array([PLACE, PLACE, by * stated.object_height, tilt, tilt, TURN])


def stated_spreads(stated: ImageTolerances, widened: float = 1.0) -> dict[str, np.ndarray]:
    """Standard deviations of each name's columns, `widened` times as stated."""
    s, by = stated, widened * stated.deviation
    six = {
        "hand_eye": (s.camera_position, s.camera_rotation),
        "base": (s.base_position, s.base_rotation),
        "held": (s.held_position, s.held_rotation),
    }
    one = {
        "camera_zeros": s.encoder, "tool_zeros": s.encoder, "camera_late": s.stamp, "tool_late": s.stamp,
        "object_scale": s.object_size, "focal": s.focal, "centre": s.centre, "radial": s.radial,
        "tangential": s.tangential, "depth_scale": s.depth_scale, "depth_offset": s.depth_offset,
        "depth_shift": s.depth_shift, "depth_bend": s.depth_bend, "depth_pattern": s.depth_pattern,
        "outline_object": s.outline, "outline_tip": s.outline, "outline_bend": s.outline_bend,
        "light": s.brightness, "tint": s.tint, "shading": s.shading, "paint_object": s.paint,
        "paint_static": s.table_paint, "depth_noise": s.depth_noise,
    }  # fmt: skip
    out = {name: by * np.repeat(widths, 3) for name, widths in six.items()}
    out |= {name: np.full(SIZES[name], by * width) for name, width in one.items()}
    # Nobody sees beyond white, and no camera_info says whether a driver resampled depth by nearest pixels.
    hidden = {name: np.ones(SIZES[name]) for name in ("white_object", "white_static", "depth_nearest")}
    return {**out, **hidden, "object": object_spreads(s)}
