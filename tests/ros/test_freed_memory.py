"""Large arrays that were freed do not stay with the process."""

from __future__ import annotations

import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="glibc's setting")

CODE = """
import sys
import numpy as np
from samrl_ros.hosting.threads import give_freed_memory_back

def anonymous_MB():
    lines = open("/proc/self/smaps_rollup").read().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("Anonymous")) / 1024

if sys.argv[1] == "back":
    give_freed_memory_back()
np.ones(20_000_000, np.uint8)  # glibc takes the size as its new limit of what is given back
before = anonymous_MB()
arrays, between = [], []
for _ in range(20):
    arrays.append(np.ones(4_000_000, np.uint8))
    between.append(np.ones(200_000, np.uint8))  # 4 MB that stay, on the heap behind an array each
del arrays
print(anonymous_MB() - before)
"""


def grown(how: str) -> float:
    done = subprocess.run([sys.executable, "-c", CODE, how], capture_output=True, text=True, check=True)
    return float(done.stdout)


def test_freed_arrays_are_given_back() -> None:
    assert grown("back") < 10.0
    assert grown("default") > 50.0  # what the setting is for; without it, the test would show nothing
