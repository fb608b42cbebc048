"""Timing: clocks that differ and data that are under way."""

from __future__ import annotations

from dataclasses import dataclass

from samrl_core.cell.instance.difference import difference


@dataclass(frozen=True, eq=False)
class Timing:
    """Delays; stamps are what a driver would give, which is not when it happened."""

    camera_latency: float = difference(
        "from the exposure until a frame is handed out",
        "s",
        "share",
        0.066,
        0.140,
        "realsense-ros issue 2686: colour 66 ms on average; librealsense issue 1242: 100 to 140 ms",
    )
    clock_offset: float = difference(
        "camera's clock ahead of the arms'",
        "s",
        "normal",
        0.001,
        0.008,
        "ASSUMPTION: one computer against two with NTP over a laboratory's network",
    )
    stamp_late: float = difference(
        "stamp after the middle of the exposure",
        "s",
        "share",
        0.004,
        0.015,
        "librealsense issue 12779: frame, backend and arrival stamps come after the sensor's",
    )
    command_delay: float = difference(
        "from a command until the controller tracks it",
        "s",
        "share",
        0.003,
        0.012,
        "ASSUMPTION: a few cycles of 1 kHz control and a network; robot_lab PR 51 adds such delays too",
    )
