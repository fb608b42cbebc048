"""A child ends with its parent, also when the parent is killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from samrl_core.common.child_process import end_with
from tests.waiting import wait_for

PARENT = """
import signal, subprocess, sys
from samrl_core.common.child_process import ends_with_parent
child = subprocess.Popen([sys.executable, "-c", sys.argv[1]], preexec_fn=ends_with_parent(int(sys.argv[2])))
print(child.pid, flush=True)
signal.pause()
"""
DEAF = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN); signal.pause()"
POLITE = """
import pathlib, signal
def note(*_):
    pathlib.Path({file!r}).touch()
    raise SystemExit
signal.signal(signal.SIGINT, note)
pathlib.Path({ready!r}).touch()
signal.pause()
"""
INTERRUPTIBLE = """
import pathlib, time
pathlib.Path({ready!r}).touch()
try:
    time.sleep(600)
except KeyboardInterrupt:
    pathlib.Path({file!r}).touch()
"""


def lives(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def start(program: str, number: int) -> tuple[subprocess.Popen[str], int]:
    command = [sys.executable, "-c", PARENT, program, str(number)]
    parent = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    return parent, int(parent.stdout.readline())


def test_a_child_that_ignores_interrupts_is_killed_with_its_parent() -> None:
    parent, child = start(DEAF, signal.SIGKILL)
    assert lives(child)
    parent.kill()
    parent.wait()
    wait_for(lambda: not lives(child), "the child's end")


def test_a_child_may_be_asked_instead(tmp_path: Path) -> None:
    noted, ready = tmp_path / "noted", tmp_path / "ready"
    parent, child = start(POLITE.format(file=str(noted), ready=str(ready)), signal.SIGINT)
    wait_for(ready.exists, "the child's start")
    parent.kill()
    parent.wait()
    wait_for(lambda: not lives(child), "the child's end")
    assert noted.exists()


def test_a_parent_that_died_before_is_noticed() -> None:
    before = signal.signal(signal.SIGUSR1, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            end_with(os.getppid() + 1, signal.SIGUSR1)
    finally:
        signal.signal(signal.SIGUSR1, before)
        end_with(os.getppid(), 0)  # not with a signal again


def test_the_child_of_a_background_job_hears_an_interrupt(tmp_path: Path) -> None:
    noted, ready = tmp_path / "noted", tmp_path / "ready"
    deaf_parent = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)" + PARENT
    default = INTERRUPTIBLE.format(file=str(noted), ready=str(ready))
    command = [sys.executable, "-c", deaf_parent, default, str(int(signal.SIGINT))]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        child = int(parent.stdout.readline())
        wait_for(ready.exists, "the child's start")
        os.kill(child, signal.SIGINT)
        wait_for(noted.exists, "the child's KeyboardInterrupt")
        parent.kill()
