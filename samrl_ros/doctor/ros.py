"""ROS 2 and its middleware: installed, configured, and carrying images between two processes."""

from __future__ import annotations

import os
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from pathlib import Path

from samrl_core.common.errors import SamrlError
from samrl_ros.doctor.check import Check, ok, problem, warning
from samrl_ros.hosting.dds import LOCAL, REACH, configure_dds, profile_for
from samrl_ros.hosting.ros_check import require_ros

MIDDLEWARE = "rmw_fastrtps_cpp"
PROFILE_VARIABLE = "FASTRTPS_DEFAULT_PROFILES_FILE"
LEAST_SEGMENT = 4 * 2**20  # of shared memory [bytes]: two images of 640x480 at once
TRIAL_S = 40.0  # wall time for two processes to find each other and talk


def check_ros() -> Check:
    """Nodes can run here: rclpy loads, and the interfaces are built."""
    try:
        require_ros()
    except SamrlError as error:
        first, _, rest = str(error).partition("\n")
        return problem("ros 2", first, " ".join(rest.split()) or "make setup")
    return ok("ros 2", f"rclpy and the interfaces load; AMENT_PREFIX_PATH={os.environ['AMENT_PREFIX_PATH']}")


def check_middleware(environment: Mapping[str, str]) -> Check:
    """The middleware that the profile is for, a domain that exists, and who can hear this cell."""
    chosen = environment.get("RMW_IMPLEMENTATION", MIDDLEWARE)
    if chosen != MIDDLEWARE:
        return warning(
            "middleware", f"RMW_IMPLEMENTATION={chosen}", f"unset it: the cell is tested with {MIDDLEWARE}"
        )
    domain = environment.get("ROS_DOMAIN_ID", "0")
    if not domain.isdecimal() or int(domain) > 101:
        return problem("middleware", f"ROS_DOMAIN_ID={domain}", "set it to a number of 0 to 101")
    reach = environment.get(REACH, LOCAL[0])
    if reach not in LOCAL:
        return warning(
            "middleware",
            f"{chosen}, domain {domain}; discovery {reach}: other computers can command the arms",
            f"unset {REACH} unless the cell runs on several computers",
        )
    return ok("middleware", f"{chosen}, domain {domain}, discovery {reach}")


def check_profile(environment: Mapping[str, str]) -> Check:
    """Room for images in the middleware's shared memory."""
    if "FASTDDS_BUILTIN_TRANSPORTS" in environment:
        return warning(
            "dds profile",
            f"FASTDDS_BUILTIN_TRANSPORTS={environment['FASTDDS_BUILTIN_TRANSPORTS']} replaces the profile",
            "unset it: built-in transports lose images of 640x480",
        )
    path = Path(environment.get(PROFILE_VARIABLE, str(profile_for(environment))))
    try:
        root = ElementTree.parse(path).getroot()
    except (OSError, ElementTree.ParseError) as error:
        return problem("dds profile", f"{path} cannot be read ({error})", f"unset {PROFILE_VARIABLE}")
    sizes = [e.text or "" for e in root.iter() if e.tag.rpartition("}")[2] == "segment_size"]
    if not any(size.strip().isdecimal() and int(size) >= LEAST_SEGMENT for size in sizes):
        return warning(
            "dds profile",
            f"{path} has no shared memory segment of {LEAST_SEGMENT} bytes or more",
            f"unset {PROFILE_VARIABLE}, or set segment_size: smaller segments lose images of 640x480",
        )
    return ok("dds profile", str(path))


def check_talk() -> Check:
    """Two processes of this computer exchange images over the middleware, as the cell's nodes do."""
    command = [sys.executable, "-m", "samrl_ros.doctor.talk_trial"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=TRIAL_S, check=False)
    except subprocess.TimeoutExpired:
        return problem("dds traffic", f"no end after {TRIAL_S:.0f} s", "samrl doctor --clean; then try again")
    said = (done.stdout.strip() or done.stderr.strip()).splitlines()
    if done.returncode == 0 and said:
        return ok("dds traffic", said[-1])
    return problem(
        "dds traffic",
        said[-1] if said else f"the trial ended with code {done.returncode}",
        "samrl doctor --clean; check firewall and ROS_DOMAIN_ID; try FASTDDS_BUILTIN_TRANSPORTS=UDPv4",
    )


def configured_environment() -> Mapping[str, str]:
    """This process's environment with the cell's defaults laid in."""
    configure_dds()
    return os.environ
