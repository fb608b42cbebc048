"""Who can reach a node of the cell. `python -m samrl_ros.doctor.reach` prints where a new node listens."""

from __future__ import annotations

import ipaddress
import os
import subprocess
import sys
import sysconfig
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from samrl_ros.doctor.check import Check, ok, problem, warning
from samrl_ros.hosting.dds import LOCAL, REACH

PORTS = Path("/proc/sys/net/ipv4/ip_local_port_range")  # where a socket that only sends gets its port from
TRIAL_S = 40.0
LISTENS = "listens on"  # before the addresses: Fast DDS prints errors of dead nodes' ports beside them
PLUGIN = b"builtin.PKI-DH"  # name of DDS security's authentication, in a library that was built with it


def open_addresses(pid: int) -> set[str]:
    """Addresses on which a process of this computer listens for datagrams or connections, without the port.

    Sockets with a port of the system's choice are left out: Fast DDS only sends with them.
    """
    inodes = set()
    for entry in Path(f"/proc/{pid}/fd").iterdir():
        try:
            target = str(entry.readlink())
        except FileNotFoundError:
            continue  # closed meanwhile
        if target.startswith("socket:["):
            inodes.add(target[8:-1])
    first_chosen = int(PORTS.read_text().split()[0])
    return {address for address, port, inode in _sockets(pid) if inode in inodes and port < first_chosen}


def _sockets(pid: int) -> Iterator[tuple[str, int, str]]:
    for table in ("udp", "udp6", "tcp", "tcp6"):
        path = Path(f"/proc/{pid}/net/{table}")
        if not path.exists():
            continue  # a kernel without IPv6
        for line in path.read_text().splitlines()[1:]:
            words = line.split()
            address, port = words[1].split(":")
            listens = words[3] == ("0A" if table.startswith("tcp") else "07")
            if listens:
                data = bytes.fromhex(address)
                groups = [data[i : i + 4][::-1] for i in range(0, len(data), 4)]  # each in the host's order
                yield str(ipaddress.ip_address(b"".join(groups))), int(port, 16), words[9]


def check_reach(environment: Mapping[str, str]) -> Check:
    """Who can reach the cell over a network, measured at a node that is started for it."""
    command = [sys.executable, "-m", "samrl_ros.doctor.reach"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=TRIAL_S, check=False)
    except subprocess.TimeoutExpired:
        return problem("network", f"no node after {TRIAL_S:.0f} s", "see dds traffic")
    addresses = printed_addresses(done.stdout)
    if done.returncode or not addresses:
        return problem("network", (done.stderr.strip() or "no node").splitlines()[-1], "see ros 2")
    outside = [a for a in addresses if not ipaddress.ip_address(a).is_loopback]
    if not outside:
        return ok("network", "nodes listen on the loopback interface alone")
    if environment.get(REACH, LOCAL[0]) not in LOCAL:
        return ok("network", f"nodes listen on {', '.join(outside)}, as {REACH} asks")
    return warning(
        "network",
        f"nodes listen on {', '.join(outside)}: who knows the address can command the arms from elsewhere",
        "unset FASTDDS_BUILTIN_TRANSPORTS and FASTRTPS_DEFAULT_PROFILES_FILE: the cell's own profile listens "
        "on the loopback interface alone",
    )


def printed_addresses(text: str) -> list[str]:
    """Addresses that a node of `main` printed, among whatever its middleware has to say."""
    told = [line for line in text.splitlines() if line.startswith(LISTENS)]
    return told[-1].removeprefix(LISTENS).split() if told else []


def check_security(environment: Mapping[str, str], libraries: Sequence[Path] = ()) -> Check:
    """Whether SROS 2 is asked for where the middleware cannot enforce it: nodes would not start."""
    asked = environment.get("ROS_SECURITY_ENABLE", "").lower() == "true"
    found = [path for path in libraries or _middleware_libraries(environment) if path.is_file()]
    if any(PLUGIN in path.read_bytes() for path in found):
        return ok("dds security", f"{found[0].name} has it; {'in force' if asked else 'not asked for'}")
    if asked:
        return problem(
            "dds security",
            "ROS_SECURITY_ENABLE=true, and Fast DDS was built without it: no node starts",
            "unset ROS_SECURITY_ENABLE and keep the cell on the loopback interface or on a network of its "
            "own; or build Fast DDS with -DSECURITY=ON",
        )
    return ok("dds security", "not built into this Fast DDS, nor asked for")


def _middleware_libraries(environment: Mapping[str, str]) -> list[Path]:
    prefixes = environment.get("AMENT_PREFIX_PATH", sysconfig.get_path("data")).split(os.pathsep)
    return [Path(prefix) / "lib" / "libfastrtps.so" for prefix in prefixes if prefix]


def main() -> int:
    """Start a node and print the addresses on which it listens."""
    import rclpy

    from samrl_ros.hosting.host import start_ros, stop_ros

    start_ros([])
    node = rclpy.create_node(f"samrl_doctor_reach_{os.getpid()}")
    print()  # Fast DDS may have begun a line
    print(LISTENS, *sorted(open_addresses(os.getpid())))
    node.destroy_node()
    stop_ros()
    return 0


if __name__ == "__main__":
    sys.exit(main())
