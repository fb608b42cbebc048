"""Who can reach the cell over a network: nobody, unless it was said otherwise."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from samrl_ros.doctor.check import Level
from samrl_ros.doctor.reach import PLUGIN, check_security, printed_addresses
from samrl_ros.hosting.dds import LOCAL_PROFILE, NETWORK_PROFILE, REACH, profile_for
from tests.faults.wire import ADDRESSES

TALKER = """
import sys, time
from samrl_ros.hosting.host import start_ros
start_ros([])
import rclpy
node, seen = rclpy.create_node(sys.argv[1]), set()
end = time.monotonic() + float(sys.argv[2])
while time.monotonic() < end and sys.argv[3] not in seen:
    rclpy.spin_once(node, timeout_sec=0.05)
    seen |= set(node.get_node_names())
print("sees", *sorted(seen), flush=True)
rclpy.spin_once(node, timeout_sec=2.0)
"""


def _environment(**changes: str) -> dict[str, str]:
    names = ("FASTDDS_BUILTIN_TRANSPORTS", "FASTRTPS_DEFAULT_PROFILES_FILE", REACH)
    return {k: v for k, v in os.environ.items() if k not in names} | changes


def test_the_two_profiles_differ_in_the_interfaces_alone() -> None:
    texts = [
        re.sub(r"<!--.*?-->|\s+", "", path.read_text(), flags=re.S)
        for path in (LOCAL_PROFILE, NETWORK_PROFILE)
    ]
    interface = "<interfaceWhiteList><address>127.0.0.1</address></interfaceWhiteList>"
    assert interface in texts[0] and texts[0].replace(interface, "") == texts[1]


def test_one_option_opens_the_cell_to_other_computers() -> None:
    assert (
        profile_for({}) == profile_for({REACH: "LOCALHOST"}) == profile_for({REACH: "OFF"}) == LOCAL_PROFILE
    )
    assert profile_for({REACH: "SUBNET"}) == profile_for({REACH: "SYSTEM_DEFAULT"}) == NETWORK_PROFILE


@pytest.mark.ros
@pytest.mark.live
@pytest.mark.parametrize(("reach", "addresses"), [("", ["127.0.0.1"]), ("SUBNET", ["0.0.0.0"])])
def test_a_node_listens_where_it_was_told(reach: str, addresses: list[str]) -> None:
    pytest.importorskip("rclpy")
    asked = {REACH: reach} if reach else {}
    command = [sys.executable, "-m", "samrl_ros.doctor.reach"]
    done = subprocess.run(command, env=_environment(**asked), capture_output=True, text=True, check=True)
    assert printed_addresses(done.stdout) == addresses


def test_errors_of_dead_nodes_ports_are_no_addresses() -> None:
    """Fast DDS prints them where nodes were killed: `samrl doctor` ended in a traceback."""
    error = "\x1b[37;1m2026-11-27 13:20:49.807 \x1b[31;1m[RTPS_TRANSPORT_SHM Error] Failed init_port"
    assert printed_addresses(f"{error}\n\nlistens on 0.0.0.0 127.0.0.1\n{error}\n") == [
        "0.0.0.0",
        "127.0.0.1",
    ]
    assert printed_addresses(error) == []


def test_security_that_cannot_be_enforced_is_refused_in_words(tmp_path: Path) -> None:
    with_it, without = tmp_path / "a.so", tmp_path / "b.so"
    with_it.write_bytes(b"..." + PLUGIN + b"...")
    without.write_bytes(b"...")
    asked = {"ROS_SECURITY_ENABLE": "true"}
    assert check_security(asked, [without]).level is Level.PROBLEM
    assert check_security(asked, [with_it]).level is Level.OK
    assert check_security({}, [without]).level is Level.OK


@pytest.fixture
def other_host() -> Iterator[str]:
    """Process id of another network with its own shared memory, at the end of a cable."""
    if os.geteuid() != 0 or not Path("/dev/net/tun").exists():
        pytest.skip("needs root and /dev/net/tun")
    set_up = "ip link set lo up && mount -t tmpfs tmpfs /dev/shm && echo ready && exec sleep infinity"
    host = subprocess.Popen(["unshare", "-n", "-m", "sh", "-c", set_up], stdout=subprocess.PIPE, text=True)
    assert host.stdout is not None and host.stdout.readline() == "ready\n"
    command = [sys.executable, "-m", "tests.faults.wire", str(host.pid)]
    wire = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert wire.stdout is not None and wire.stdout.readline() == "ready\n"
    yield str(host.pid)
    for process in (wire, host):
        process.kill()
        process.wait()


@pytest.mark.slow
@pytest.mark.ros
@pytest.mark.live
@pytest.mark.parametrize(("reach", "met"), [("LOCALHOST", False), ("SUBNET", True)])
def test_an_outsider_who_knows_the_address_comes_in_only_where_asked(
    other_host: str, reach: str, met: bool
) -> None:
    pytest.importorskip("rclpy")
    patience = 60.0 if met else 15.0  # an outsider who is let in needs a second or two
    inside = subprocess.Popen(
        [sys.executable, "-c", TALKER, "inside", str(patience), "outside"],
        env=_environment(**{REACH: reach}),
        stdout=subprocess.PIPE,
        text=True,
    )
    enter = ["nsenter", f"--net=/proc/{other_host}/ns/net", f"--mount=/proc/{other_host}/ns/mnt"]
    outside = subprocess.Popen(
        [*enter, sys.executable, "-c", TALKER, "outside", str(patience), "inside"],
        env=_environment(**{REACH: "SUBNET", "ROS_STATIC_PEERS": ADDRESSES[0]}),
        stdout=subprocess.PIPE,
        text=True,
    )
    said = [process.communicate(timeout=300)[0] for process in (inside, outside)]
    assert ("outside" in said[0].split(), "inside" in said[1].split()) == (met, met), said
