"""From where a thread's end may go down into the eye, and where it goes first if it may not."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

_SLANT = 0.25  # aside over down of a way that is aslant: 3 mm where the end is 12 mm above the eye [-]
_LEVEL = 2e-3  # what is this near to the hover is there [m]


@dataclass(frozen=True)
class WayIn:
    """Of a needle whose eye has a vertical axis.

    Where the eye is found in images, each of them moves it by half a millimetre or more. An end that had to
    be over its middle that well would be sent up and aside again and again, so that it goes in aslant: what
    is aside shrinks on the way down, and is measured again after each step.
    """

    clearance: float  # radius of the eye less that of the thread [m]
    hover: float  # of the end above the eye's centre before it goes down [m]
    aslant: bool  # whether the end is led straight to the eye from aside, where the eye is found in images

    def height(self, high: float) -> float:
        """At which an end that is so `high` goes aside, both above the eye's centre [m].

        On a way aslant it stays where it is, if it is clear of the ring there; else it goes to the hover.
        """
        return min(max(high, 0.5 * self.hover), self.hover) if self.aslant else self.hover

    def is_free(self, from_eye: np.ndarray) -> bool:
        """Whether an end that lies so (3,) from the eye's centre [m] goes down."""
        aside, high = math.hypot(from_eye[0], from_eye[1]), float(from_eye[2])
        # On the way down more is allowed, or a swing of the thread would send it up again and again.
        allowed = (0.8 if high < self.hover - _LEVEL else 0.4) * self.clearance
        if self.aslant:
            allowed = max(0.8 * self.clearance, _SLANT * high)
        return aside < allowed and high < self.hover + _LEVEL

    def aside_at_first(self, bend: np.ndarray) -> np.ndarray:
        """How far (3,) from the eye's centre the first point above the end passes it [m].

        Drawn into the middle, it would draw an end aside that is hardly in, and out where it is higher than
        believed. So it passes where it hangs, within half of the clearance.

        Args:
            bend: (3,) from the end to that point [m].
        """
        beside = np.array([bend[0], bend[1], 0.0])
        length = float(np.linalg.norm(beside))
        if not self.aslant or length == 0.0:
            return np.zeros(3)
        return beside * min(1.0, 0.5 * self.clearance / length)
