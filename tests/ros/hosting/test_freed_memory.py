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

every_s, array, stays = float(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
if every_s:
    memory = FreedMemory(every_s)
np.ones(20_000_000, np.uint8)  # glibc takes the size as its new limit of what is given back
before = anonymous_MB()
arrays, between = [], []
for _ in range(80_000_000 // array):
    arrays.append(np.ones(array, np.uint8))
    between.append(np.ones(stays, np.uint8))  # stays, on the heap behind an array each
del arrays
time.sleep(1.0 if every_s < 1.0 else 0.0)
print(anonymous_MB() - before)
"""


def grown(every_s: float, array: int, stays: int) -> float:
    """Memory [MB] left by 80 MB of arrays that were freed, each beside a small one that stays [bytes].

    The heap is trimmed every so many seconds; with 0 s all is as glibc has it.
    """
    command = [sys.executable, "-c", CODE, str(every_s), str(array), str(stays)]
    return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


@pytest.mark.parametrize(("array", "stays"), [(4_000_000, 200_000), (400_000, 2_000)])
def test_freed_arrays_are_given_back(array: int, stays: int) -> None:
    assert grown(0.2, array, stays) < 10.0
    assert grown(0.0, array, stays) > 50.0  # what it is for; without it, the test would show nothing


def test_a_rendering_leaves_no_holes_between_images_that_stay() -> None:
    """Before the heap is trimmed: arrays of an image of 128 x 128 beside images that a node keeps."""
    assert grown(3600.0, 460_000, 50_000) < 20.0  # what stays is 9 MB of it
    assert grown(0.0, 460_000, 50_000) > 50.0
