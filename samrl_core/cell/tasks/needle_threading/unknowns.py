"""What is unknown beside the thread's shape where the needle may stand elsewhere than drawn.

Behind the thread's angles stand, in this order: the eye's place in x and y, the needle's turn about its own
axis, the thread's length over the drawn one, and how far the camera shows everything beside where the
encoders have it. The last keeps the needle's place in the frame of the encoders, which actions need: what
shifts thread and needle alike in an image is the camera's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from samrl_core.cell.tasks.task import ParameterSpec, camera_specs

PLACE, TURN, LENGTH, CAMERA = slice(0, 2), 2, 3, slice(4, 7)  # behind the angles
COUNT = 7


@dataclass(frozen=True)
class NeedleUnknowns:
    """What is believed before the first image; bounds are twice as wide, or more."""

    place: float  # the eye is within +- this of where it is drawn, in x and y [m]
    turn: float = 0.1  # standard deviation [rad]
    # Within +- this share of the drawn one [-]. Its bounds are half as far again: cells that nobody measured
    # have such threads, and a second view tells the length to a hundredth, whatever was believed.
    length: float = 0.0
    camera: float = 0.0025  # standard deviation per axis [m]

    def specs(self, eye_x: float, eye_y: float) -> tuple[ParameterSpec, ...]:
        """Declared parameters of a needle drawn with its eye there [m]."""
        place, length = self.place / math.sqrt(3.0), self.length / math.sqrt(3.0)
        rows = (
            ("needle_x", "m", eye_x, place, 2.0 * self.place),
            ("needle_y", "m", eye_y, place, 2.0 * self.place),
            ("needle_turn", "rad", 0.0, self.turn, 4.0 * self.turn),
            ("thread_length", "-", 1.0, length, 1.5 * self.length),
        )
        constant = (
            ParameterSpec(name, unit, middle, scale, middle - far, middle + far, "constant")
            for name, unit, middle, scale, far in rows
        )
        return (*constant, *camera_specs(self.camera))

    def nominal(self, eye_x: float, eye_y: float, length: float) -> np.ndarray:
        """(7,) of a needle that stands there [m], of a thread of that length over the drawn one."""
        return np.array([eye_x, eye_y, 0.0, length, 0.0, 0.0, 0.0])
