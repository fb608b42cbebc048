"""Stopping the cell's processes: what is slow is waited for, what hangs is killed and told."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from samrl_ros.cell import node_group

SLOW = """
import signal, sys, time
def stop(*_):
    for _ in range(30):
        time.sleep(0.05)
        sum(range(300000))
    sys.exit(0)
signal.signal(signal.SIGINT, stop)
print("ready", flush=True)
while True:
    time.sleep(1)
"""
DEAF = """
import signal, time
signal.signal(signal.SIGINT, signal.SIG_IGN)
print("ready", flush=True)
while True:
    time.sleep(1)
"""
SPINNING = DEAF.replace("    time.sleep(1)", "    pass")


def _group(folder: Path, **programs: str) -> node_group.ProcessGroup:
    group = node_group.ProcessGroup([], folder)
    for name, program in programs.items():
        child = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE)
        assert child.stdout is not None and child.stdout.readline() == b"ready\n"
        group._children[name] = child
    return group


def test_a_process_that_works_is_waited_for_beyond_the_time_of_one_that_hangs(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(node_group, "STOP_TIMEOUT_S", 1.0)  # the slow one needs 1.5 s of sleep alone
    group = _group(tmp_path, slow=SLOW)
    assert group.stop() == ""
    assert group._children["slow"].returncode == 0


@pytest.mark.parametrize("program", [DEAF, SPINNING])
def test_a_process_that_hangs_is_killed_and_told(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, program: str
) -> None:
    monkeypatch.setattr(node_group, "STOP_TIMEOUT_S", 0.5)
    group = _group(tmp_path, hung=program)
    assert group.stop() == "hung did not stop within 0.5 s and was killed"
    assert group._children["hung"].poll() is not None
