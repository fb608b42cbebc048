"""Depth: what a stereo camera's depth has on top of the nominal sensor's noise."""

from __future__ import annotations

from dataclasses import dataclass

from samrl_core.cell.instance.difference import difference

_SPEC = (
    "Intel D400 datasheet: absolute error at most 2 % up to 2 m; how much a calibration leaves is ASSUMPTION"
)
_EDGES = "ASSUMPTION: smear of stereo matching windows, as anybody sees in a D435's cloud"


@dataclass(frozen=True, eq=False)
class Depth:
    """Errors of depth: reading = (1 + scale) z + bias, more noise, worse edges."""

    scale: float = difference("share of the distance", "-", "normal", 0.004, 0.012, _SPEC)
    bias: float = difference("offset", "m", "normal", 0.001, 0.003, _SPEC)
    subpixel: float = difference(
        "standard deviation of the disparity beyond the nominal 0.08 px",
        "px",
        "share",
        0.06,
        0.20,
        "ASSUMPTION: Intel's tuning guide has 0.08 px where there is texture; a bare table has little",
    )
    shift: float = difference(
        "colour against depth, share of the image's width",
        "-",
        "normal",
        0.003,
        0.010,
        "ASSUMPTION: 0.4 of 128 px, the colour imager's bracket 15 mm from the depth module",
    )
    mixed_edges: float = difference(
        "probability that an edge pixel has a depth between both sides", "-", "share", 0.30, 0.45, _EDGES
    )
    speckle: float = difference("probability that any pixel has no depth", "-", "share", 0.01, 0.04, _EDGES)
