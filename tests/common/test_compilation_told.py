"""The first use of a kernel says on the error stream what is compiled; the next one is silent."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import warp as wp

from samrl_core.common import warp_runtime

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


@pytest.mark.thorough
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


def test_threads_that_compile_the_same_tell_it_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    compiled: list[str] = []
    monkeypatch.setattr(wp.Module, "_compile", lambda module, *_: compiled.append(module.name))
    warp_runtime._announce_compilation()
    for name, device in (("a", "cpu"), ("a", "cpu"), ("a", "cuda:0"), ("b", "cpu")):
        getattr(wp.Module, "_compile")(SimpleNamespace(name=name), device, str(tmp_path), "missing.o")  # noqa: B009
    assert compiled == ["a", "a", "a", "b"]
    told = [line.split(";")[0] for line in capsys.readouterr().err.splitlines()]
    assert told == [f"compiling kernels: {what}" for what in ("a for cpu", "a for cuda:0", "b for cpu")]
