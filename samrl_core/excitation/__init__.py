"""Recording programmes: motions that make a robot show what its model leaves out."""

from __future__ import annotations

from samrl_core.excitation.catalogue import KINDS
from samrl_core.excitation.programme import SETS, GainScale, gains, programme
from samrl_core.excitation.programme_file import ProgrammeFile
from samrl_core.excitation.runs import Run, file_runs, set_run

__all__ = [
    "KINDS",
    "SETS",
    "GainScale",
    "ProgrammeFile",
    "Run",
    "file_runs",
    "gains",
    "programme",
    "set_run",
]
