"""Arrays that were freed do not stay with the process."""

from __future__ import annotations

import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="glibc's setting")

CODE = """
import sys
import time
import numpy as np
from samrl_ros.hosting.threads import FreedMemory

def anonymous_MB():
    lines = open("/proc/self/smaps_rollup").read().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("Anonymous")) / 1024

how, array, stays = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
if how == "back":
    memory = FreedMemory(0.2)
np.ones(20_000_000, np.uint8)  # glibc takes the size as its new limit of what is given back
before = anonymous_MB()
arrays, between = [], []
for _ in range(80_000_000 // array):
    arrays.append(np.ones(array, np.uint8))
    between.append(np.ones(stays, np.uint8))  # stays, on the heap behind an array each
del arrays
time.sleep(1.0)
print(anonymous_MB() - before)
"""


def grown(how: str, array: int, stays: int) -> float:
    """Memory [MB] left by 80 MB of arrays that were freed, each beside a small one that stays [bytes]."""
    command = [sys.executable, "-c", CODE, how, str(array), str(stays)]
    return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


@pytest.mark.parametrize(("array", "stays"), [(4_000_000, 200_000), (400_000, 2_000)])
def test_freed_arrays_are_given_back(array: int, stays: int) -> None:
    assert grown("back", array, stays) < 10.0
    assert grown("default", array, stays) > 50.0  # what it is for; without it, the test would show nothing
