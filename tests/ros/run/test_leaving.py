"""The last thing that a run does, after its summary is written: it leaves the graph, or the process ends."""

from __future__ import annotations

import subprocess
import sys

STUCK = """
import ctypes
from samrl_ros.cell.run import leave_graph
left = []
leave_graph([lambda: left.append("ros"), lambda: left.append("monitor")])
print(*left, flush=True)
stand_still = ctypes.PyDLL(None).sleep  # with Python's lock in hand, as in the middleware's destructors
leave_graph([lambda: stand_still(60)], 0.2)
"""


def test_a_middleware_that_lets_nobody_go_ends_the_process() -> None:
    """The last opened is closed first; no signal would end the other one."""
    found = subprocess.run(
        [sys.executable, "-c", STUCK], capture_output=True, text=True, timeout=50, check=False
    )
    assert found.stdout == "monitor ros\n"
    assert found.returncode == 1 and "Timeout" in found.stderr and "leave_graph" in found.stderr
