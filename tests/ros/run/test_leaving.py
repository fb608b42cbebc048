"""The last thing that a command does, after all is told: it leaves the graph, or the process ends."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from rich.console import Console

from samrl_ros.cell import observed
from samrl_ros.contract.topics import arm_topic

STUCK = """
import ctypes
from samrl_ros.hosting.host import on_graph
left = []
with on_graph([]) as closers:
    closers += [lambda: left.append("node"), lambda: left.append("monitor")]
print(*left, flush=True)
stand_still = ctypes.PyDLL(None).sleep  # with Python's lock in hand, as in the middleware's destructors
with on_graph([], 0.2) as closers:
    closers.append(lambda: stand_still(60))
    print("told", flush=True)
"""
BY_ITSELF = {"hosting/host.py", "hosting/__init__.py", "doctor/talk_trial.py", "doctor/reach.py"}


@pytest.mark.ros
def test_a_middleware_that_lets_nobody_go_ends_the_process() -> None:
    """The last opened is closed first; no signal would end the other one."""
    found = subprocess.run(
        [sys.executable, "-c", STUCK], capture_output=True, text=True, timeout=50, check=False
    )
    assert found.stdout == "monitor node\ntold\n"
    assert found.returncode == 1 and "Timeout" in found.stderr and "leave_graph" in found.stderr


def test_every_command_leaves_by_the_one_rule() -> None:
    """The doctor's two trials are processes that it ends itself."""
    root = Path(observed.__file__).parents[1]
    found = {
        str(file.relative_to(root))
        for file in root.rglob("*.py")
        if re.search(r"\bstop_ros\b", file.read_text())
    }
    assert found == BY_ITSELF


@pytest.mark.parametrize("count", [0, 700])
def test_a_run_that_observes_tells_what_it_heard(
    count: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    topics = (SimpleNamespace(name=arm_topic("tool_arm", "joint_states"), count=count),)
    monkeypatch.setattr(observed, "open_bag", lambda bag: SimpleNamespace(topics=topics))
    assert observed.tell_what_was_heard(Path("out/bag"), Console()) is bool(count)
    said = capsys.readouterr().out
    assert ("700 joint states of tool_arm in out/bag" in said) is bool(count)
    assert ("nothing was heard" in said) is not bool(count)
