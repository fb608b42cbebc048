"""Forge and diagnosis know nothing of each other: a blind test stays blind."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.architecture.import_rules import ROOT, imports_of_project, module_of

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


@pytest.mark.parametrize("source, target", FORBIDDEN)
def test_no_import(source: str, target: str) -> None:
    found = [i for i in imports_of_project() if module_of(i.file).startswith(source + ".")]
    assert found
    wrong = [f"{i.file}:{i.line}" for i in found if f"{i.module}.".startswith(target + ".")]
    assert not wrong


def test_the_diagnosis_loads_neither_forge_nor_scoring() -> None:
    """Nor torch, which takes longer to load than a short log to diagnose."""
    code = (
        "import sys, samrl_core.diagnosis.diagnose;"
        "parts = ('samrl_core.blind_test', 'torch');"
        "bad = [m for m in sys.modules if m.startswith(parts)]; sys.exit(str(bad) if bad else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
