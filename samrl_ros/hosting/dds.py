"""Middleware defaults of the cell, set as environment variables before the first node exists."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from pathlib import Path

from samrl_core.common.errors import InputError

HERE = Path(__file__).resolve().parent
LOCAL_PROFILE, NETWORK_PROFILE = HERE / "dds_profile_local.xml", HERE / "dds_profile.xml"
REACH = "ROS_AUTOMATIC_DISCOVERY_RANGE"
DOMAIN = "ROS_DOMAIN_ID"
LAST_DOMAIN = 232  # beyond it the ports of RTPS end at 65535: Fast DDS ends the process without our word
LOCAL = ("LOCALHOST", "OFF")  # of its values: nobody on another computer is wanted


def profile_for(environment: Mapping[str, str]) -> Path:
    """The Fast DDS profile for the reach that is asked for: this computer, unless said otherwise."""
    return LOCAL_PROFILE if environment.get(REACH, LOCAL[0]) in LOCAL else NETWORK_PROFILE


def check_domain(environment: Mapping[str, str]) -> None:
    """Refuse a ROS domain that the middleware has no ports for.

    Raises:
        InputError: ROS_DOMAIN_ID is no number of 0 to 232; unset or empty is 0.
    """
    text = environment.get(DOMAIN, "").strip() or "0"
    if not (text.isascii() and text.isdecimal()) or int(text) > LAST_DOMAIN:
        raise InputError(f"{DOMAIN} is {text!r}, must be a number of 0 to {LAST_DOMAIN}, best of 0 to 101")


def configure_dds() -> None:
    """Set defaults that the user's own environment overrides. Call before `rclpy.init`.

    - Discovery on this computer alone, and sockets on its loopback interface alone, so that no other machine
      reaches the control loop. For a cell over several computers set ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET on
      each.
    - A Fast DDS profile with room for large images; left out when the user chose other transports, which
      listen on every interface.
    - This Python environment as ament prefix, which the ROS wheels do not announce.
    """
    os.environ.setdefault(REACH, LOCAL[0])
    if "FASTDDS_BUILTIN_TRANSPORTS" not in os.environ:
        os.environ.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", str(profile_for(os.environ)))
    os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)
