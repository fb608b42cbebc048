"""Grip: how what is held sits between the fingers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.instance.difference import difference

_HAND = (
    "ASSUMPTION: parts taken from a tray by parallel fingers; work on insertion by learning randomises the"
    " pose in hand by 1 to 3 mm and up to 5 deg"
)


@dataclass(frozen=True, eq=False)
class Grip:
    """The held part's pose about the fingertip centre, flange axes; the hand stays where it is."""

    position: np.ndarray = difference("offset of the held part", "m", "normal", 0.0005, 0.0015, _HAND, (3,))
    rotation: np.ndarray = difference(
        "tilt of the held part, rotation vector", "rad", "normal", 0.008, 0.025, _HAND, (3,)
    )
