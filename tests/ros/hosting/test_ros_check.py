"""Missing, half installed and doubly installed ROS give one clear error each."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from samrl_core.common.errors import InputError
from samrl_ros.hosting import dds, ros_check
from samrl_ros.hosting.ros_check import RosMissingError, ros_clash
from tests.waiting import PATIENCE_S

WAYS = ("pip install 'samrl[ros]'", "source /opt/ros/jazzy/setup.bash", "uv sync --reinstall")


def _hide(monkeypatch: pytest.MonkeyPatch, hidden: str) -> None:
    real = ros_check.importlib.util.find_spec

    def find_spec(name: str, package: str | None = None) -> Any:
        return None if name == hidden else real(name, package)

    monkeypatch.setattr(ros_check.importlib.util, "find_spec", find_spec)
    monkeypatch.delenv("ROS_DISTRO", raising=False)


def test_a_missing_rclpy_names_three_ways(monkeypatch: pytest.MonkeyPatch) -> None:
    _hide(monkeypatch, "rclpy")
    monkeypatch.setattr(ros_check, "_version", lambda name: None)
    with pytest.raises(RosMissingError, match="no module rclpy") as caught:
        ros_check.require_ros()
    for way in WAYS:
        assert way in str(caught.value)


def test_files_removed_by_uv_sync_are_recognised(monkeypatch: pytest.MonkeyPatch) -> None:
    _hide(monkeypatch, "rclpy")
    monkeypatch.setattr(ros_check, "_version", lambda name: "7.1.6")
    with pytest.raises(RosMissingError, match=r"ros-rclpy 7\.1\.6 is installed, but .* uv sync"):
        ros_check.require_ros()


@pytest.mark.ros
def test_missing_interfaces_name_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    _hide(monkeypatch, "samrl_msgs")
    with pytest.raises(RosMissingError, match=r"python -m samrl_ros\.interfaces\.build"):
        ros_check.require_ros()


def test_wheels_and_a_sourced_system_ros_clash() -> None:
    assert "their libraries mix" in ros_clash("7.1.6", {"ROS_DISTRO": "jazzy"})
    assert ros_clash(None, {"ROS_DISTRO": "jazzy"}) == ""  # a system ROS alone
    assert ros_clash("7.1.6", {}) == ""  # the wheels alone


@pytest.mark.ros
def test_this_environment_can_run_nodes() -> None:
    ros_check.require_ros()


def test_middleware_defaults_give_way_to_the_user(monkeypatch: pytest.MonkeyPatch) -> None:
    names = ("FASTRTPS_DEFAULT_PROFILES_FILE", "ROS_AUTOMATIC_DISCOVERY_RANGE", "AMENT_PREFIX_PATH")
    for name in (*names, "FASTDDS_BUILTIN_TRANSPORTS"):
        monkeypatch.setenv(name, "")  # remembered, so that the original comes back
        monkeypatch.delenv(name)
    dds.configure_dds()
    assert Path(os.environ["FASTRTPS_DEFAULT_PROFILES_FILE"]).is_file()
    assert os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    assert os.environ["AMENT_PREFIX_PATH"] == sys.prefix
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
    monkeypatch.setenv("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
    monkeypatch.delenv("FASTRTPS_DEFAULT_PROFILES_FILE")
    dds.configure_dds()
    assert os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "SUBNET"
    assert "FASTRTPS_DEFAULT_PROFILES_FILE" not in os.environ


@pytest.mark.ros
def test_the_profile_lets_a_large_best_effort_image_through(ros_domain: int) -> None:
    """Two processes, 640x480 colour images at 30 Hz: the built-in 512 KiB segment loses most of them."""
    receiver = (
        "import rclpy, sys, time\n"
        "from samrl_ros.hosting import start_ros, stop_ros\n"
        "from samrl_ros.contract.qos import PROFILES\n"
        "from sensor_msgs.msg import Image\n"
        "start_ros([])\n"
        "node = rclpy.create_node(sys.argv[1])\n"
        "count = 0\n"
        "def take(message):\n"
        "    global count\n"
        "    count += 1\n"
        "if sys.argv[1] == 'receiver':\n"
        "    node.create_subscription(Image, '/image', take, PROFILES['sensor'])\n"
        "    end = time.monotonic() + 600\n"
        "    idle = None\n"
        "    while time.monotonic() < end and count < 30 and (idle is None or time.monotonic() < idle):\n"
        "        before = count\n"
        "        rclpy.spin_once(node, timeout_sec=0.1)\n"
        "        idle = time.monotonic() + 10 if count > before else idle\n"
        "    print(count)\n"
        "else:\n"
        "    publisher = node.create_publisher(Image, '/image', PROFILES['sensor'])\n"
        "    end = time.monotonic() + 600\n"
        "    while publisher.get_subscription_count() == 0 and time.monotonic() < end:\n"
        "        time.sleep(0.02)\n"
        "    time.sleep(0.3)\n"
        "    data = bytes(640 * 480 * 3)\n"
        "    for _ in range(30):\n"
        "        publisher.publish(Image(width=640, height=480, step=1920, encoding='rgb8', data=data))\n"
        "        time.sleep(1 / 30)\n"
        "    time.sleep(1.0)\n"
        "node.destroy_node()\n"
        "stop_ros()\n"
    )
    root = str(Path(__file__).resolve().parents[3])
    environment = {name: value for name, value in os.environ.items() if name != "FASTDDS_BUILTIN_TRANSPORTS"}
    environment["PYTHONPATH"] = root
    command = [sys.executable, "-c", receiver]
    listening = subprocess.Popen([*command, "receiver"], env=environment, stdout=subprocess.PIPE, text=True)
    try:
        subprocess.run([*command, "sender"], env=environment, check=True, timeout=PATIENCE_S)
        output, _ = listening.communicate(timeout=PATIENCE_S)
    finally:
        if listening.poll() is None:
            listening.kill()
            listening.communicate()
    assert int(output.split()[-1]) >= 27  # of 30


@pytest.mark.parametrize("domain", ["233", "999", "-1", "abc", "1.5"])
def test_a_ros_domain_without_ports_is_refused_in_words(domain: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fast DDS ends the process at such a number, with two lines of its own."""
    pytest.importorskip("rclpy")
    from samrl_ros.hosting.host import start_ros

    monkeypatch.setenv(dds.DOMAIN, domain)
    with pytest.raises(InputError, match=f"ROS_DOMAIN_ID is '{domain}', must be a number of 0 to 232"):
        start_ros([])


@pytest.mark.parametrize("environment", [{}, {"ROS_DOMAIN_ID": ""}, {"ROS_DOMAIN_ID": "232"}])
def test_a_ros_domain_with_ports_is_not(environment: dict[str, str]) -> None:
    dds.check_domain(environment)
