"""Forge and diagnosis know nothing of each other: a blind test stays blind."""

from __future__ import annotations

import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from tests.architecture.import_rules import LAYERS, Import, imports_below, part_of

ROOT = Path(__file__).parents[2]
# the forge has engines of its own, so that a mistake of the simulator is not repeated in the sealed worlds
FORBIDDEN = [("forge", "diagnosis"), ("forge", "dynamics"), ("diagnosis", "forge"), ("dynamics", "forge"),
             ("dynamics", "diagnosis")]  # fmt: skip


@cache
def _imports() -> tuple[Import, ...]:
    return tuple(imports_below(ROOT, ("samrl_core",)))


@pytest.mark.parametrize("source, target", FORBIDDEN)
def test_no_import(source: str, target: str) -> None:
    found = _imports()
    assert any(part_of(i.file) == source for i in found)
    wrong = [f"{i.file}:{i.line}" for i in found if part_of(i.file) == source and part_of(i.module) == target]
    assert not wrong


def test_the_forge_lies_below_the_diagnosis() -> None:
    level = {part: number for number, parts in enumerate(LAYERS) for part in parts}
    assert level["dynamics"] < level["forge"] < level["diagnosis"] < level["report"] < level["scoring"]


def test_the_diagnosis_loads_neither_forge_nor_scoring() -> None:
    code = (
        "import sys, samrl_core.diagnosis.diagnose;"
        "parts = ('samrl_core.forge', 'samrl_core.scoring');"
        "bad = [m for m in sys.modules if m.startswith(parts)]; sys.exit(str(bad) if bad else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
