"""Forge and diagnosis know nothing of each other: a blind test stays blind."""

from __future__ import annotations

import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from tests.architecture.import_rules import Import, imports_below, module_of

ROOT = Path(__file__).parents[2]
MAKES_WORLDS = tuple(f"samrl_core.blind_test.{room}" for room in ("engines", "disturbances", "worlds"))
# The sealed worlds have engines of their own, so that a mistake of the simulator is not repeated in them.
FORBIDDEN = [
    *((room, "samrl_core.diagnosis") for room in MAKES_WORLDS),
    ("samrl_core.diagnosis", "samrl_core.blind_test"),
    *(
        ("samrl_core.diagnosis.simulation", f"samrl_core.diagnosis.{room}")
        for room in ("residuals", "effects", "selection", "report")
    ),
]


@cache
def _imports() -> tuple[Import, ...]:
    return tuple(imports_below(ROOT, ("samrl_core",)))


@pytest.mark.parametrize("source, target", FORBIDDEN)
def test_no_import(source: str, target: str) -> None:
    found = [i for i in _imports() if module_of(i.file).startswith(source + ".")]
    assert found
    wrong = [f"{i.file}:{i.line}" for i in found if f"{i.module}.".startswith(target + ".")]
    assert not wrong


def test_the_diagnosis_loads_neither_forge_nor_scoring() -> None:
    code = (
        "import sys, samrl_core.diagnosis.diagnose;"
        "parts = ('samrl_core.blind_test',);"
        "bad = [m for m in sys.modules if m.startswith(parts)]; sys.exit(str(bad) if bad else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
