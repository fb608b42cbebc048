"""The pre-flight over DDS, against processes that speak the drivers' topics."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from samrl_ros.contract.exit_codes import FAILED, OK
from tests.waiting import wait_for

pytest.importorskip("rclpy")
pytestmark = [pytest.mark.ros, pytest.mark.live]


@pytest.fixture
def fake_drivers(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "83")
    children = []

    def start(offset_s: float) -> None:
        command = [sys.executable, str(Path(__file__).with_name("fake_drivers.py")), str(offset_s)]
        children.append(subprocess.Popen(command))

    yield start
    for child in children:
        child.kill()
        child.wait()


def preflight() -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "samrl_ros.cli.main", "preflight", "--seconds", "1"]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_drivers_that_agree_pass_and_a_clock_that_is_off_does_not(
    fake_drivers: Callable[[float], None],
) -> None:
    silent = preflight()
    assert silent.returncode == FAILED and "0 messages heard" in silent.stdout

    fake_drivers(0.0)
    wait_for(lambda: preflight().returncode == OK, "the drivers agree in one window")


def test_a_clock_that_is_off_is_refused(fake_drivers: Callable[[float], None]) -> None:
    fake_drivers(5.0)
    said: list[str] = []

    def told() -> bool:
        done = preflight()
        assert done.returncode == FAILED, done.stdout
        said.append(done.stdout)
        return "stamped" in done.stdout and "after its reception" in done.stdout

    wait_for(told, f"the clock is told: {said[-1:]}")
