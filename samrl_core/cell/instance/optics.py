"""Optics: lens and exposure of the colour camera, against its calibration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.instance.difference import difference

_FACTORY = (
    "ASSUMPTION: factory intrinsics of a D400 hold to a few tenths of a per cent; a user who types in the"
    " datasheet's field of view (+-3 deg of 69) is off by several"
)
_LENS = (
    "ASSUMPTION: the D435's driver announces zero distortion for colour, no lens has none; 0.02 moves a"
    " corner pixel of a 42 deg image by 0.4 of 128 px"
)


@dataclass(frozen=True, eq=False)
class Optics:
    """Errors of the lens: true focal length = nominal (1 + error), and so on."""

    focal: np.ndarray = difference(
        "focal lengths fx and fy, share of them", "-", "normal", 0.003, 0.012, _FACTORY, (2,)
    )
    centre: np.ndarray = difference(
        "principal point, share of width and height", "-", "normal", 0.003, 0.010, _FACTORY, (2,)
    )
    radial: np.ndarray = difference("Brown's k1 and k2", "-", "normal", 0.02, 0.06, _LENS, (2,))
    tangential: np.ndarray = difference("Brown's p1 and p2", "-", "normal", 0.0005, 0.002, _LENS, (2,))
    focus: float = difference(
        "standard deviation of the blur when all stands still",
        "px",
        "share",
        0.45,
        0.8,
        "ASSUMPTION: a fixed focus at 0.3 to 0.45 m, binned to 128 px",
    )
    exposure_time: float = difference(
        "shutter: what moves meanwhile is smeared",
        "s",
        "share",
        0.012,
        0.033,
        "librealsense: colour exposure 15.6 ms unless set; 33 ms is a whole frame at 30 Hz in a dark room",
    )
    exposure: float = difference(
        "brightness, share of it",
        "-",
        "normal",
        0.05,
        0.15,
        "ASSUMPTION: auto exposure that settled on another scene",
    )
