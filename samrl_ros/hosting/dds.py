"""Middleware defaults of the cell, set as environment variables before the first node exists."""

from __future__ import annotations

import os
import sys
from pathlib import Path

PROFILE = Path(__file__).resolve().parent / "dds_profile.xml"


def configure_dds() -> None:
    """Set defaults that the user's own environment overrides. Call before `rclpy.init`.

    - A Fast DDS profile with room for large images; left out when the user chose other transports.
    - Discovery on this computer alone, so that no other machine disturbs the control loop. For a cell over
      several computers set ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET on each.
    - This Python environment as ament prefix, which the ROS wheels do not announce.
    """
    if "FASTDDS_BUILTIN_TRANSPORTS" not in os.environ:
        os.environ.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", str(PROFILE))
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)
