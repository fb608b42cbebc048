"""The first use of a kernel says on the error stream what is compiled; the next one is silent."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

PROGRAM = """
import warp as wp
from samrl_core.common.warp_runtime import start

@wp.kernel
def fill(values: wp.array(dtype=float)):
    values[wp.tid()] = 1.0

start()
values = wp.zeros(2, dtype=float, device="cpu")
wp.launch(fill, dim=2, inputs=[values], device="cpu")
print(values.numpy().sum())
"""


def test_only_the_first_start_tells_what_it_compiles(tmp_path: Path) -> None:
    program = tmp_path / "toy_kernels.py"
    program.write_text(PROGRAM)
    environment = {**os.environ, "SAMRL_WARP_CACHE": str(tmp_path / "cache")}
    errors = []
    for _ in range(2):
        command = [sys.executable, str(program)]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        assert done.stdout == "2.0\n"
        errors.append(done.stderr)
    assert errors[0].startswith("compiling kernels: __main__ for cpu") and errors[0].count("\n") == 1
    assert errors[1] == ""
