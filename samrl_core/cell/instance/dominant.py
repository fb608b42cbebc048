"""One error of a cell that stands out: what somebody got wrong, on top of what every cell differs in.

By the family of the effect that a diagnosis would name. A factor of 1 is what is met in practice where nobody
checked; each is drawn in its own direction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.common.streams import stream


@dataclass(frozen=True)
class Dominant:
    """Sizes at factor 1, by the fields of one group that they are added to; vectors have that length."""

    group: str
    sizes: dict[str, tuple[float, int]]  # size and length by field; length 0 is a number
    source: str

    def add_to(self, name: str, factor: float, seed: int, path: tuple[str, ...]) -> dict[str, np.ndarray]:
        """What is added to each field; the same for a name, whatever its factor."""
        added = {}
        for field, (size, length) in self.sizes.items():
            drawn = stream(seed, *path, name, field).standard_normal(max(length, 1))
            drawn /= np.linalg.norm(drawn)
            added[field] = factor * size * (drawn if length else drawn[0])
        return added


DOMINANT: dict[str, Dominant] = {
    "hand_eye": Dominant(
        "calibration",
        {"hand_eye_position": (0.005, 3), "hand_eye_rotation": (0.0175, 3)},
        "Zivid: 3.2 mm and 0.76 deg on average with a sagging mount",
    ),
    "base_to_base": Dominant(
        "calibration",
        {"camera_base_position": (0.010, 3), "camera_base_rotation": (0.0175, 3)},
        "ASSUMPTION: bases measured with a tape",
    ),
    "depth_scale": Dominant(
        "depth", {"scale": (0.02, 0)}, "Intel D400 datasheet: at most 2 % of the distance"
    ),
    "depth_offset": Dominant("depth", {"bias": (0.008, 0)}, "2 % of 0.4 m"),
    "intrinsics": Dominant(
        "optics", {"focal": (0.03, 2), "centre": (0.03, 2)}, "datasheet's field of view +-3 deg of 69"
    ),
    "lens_distortion": Dominant(
        "optics", {"radial": (0.2, 2)}, "ASSUMPTION: a wide lens whose distortion nobody calibrated"
    ),
}
