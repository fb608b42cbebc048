"""Recording programmes: motions that make a robot show what its model leaves out."""

from __future__ import annotations

from samrl_core.cell.excitation.catalogue import KINDS
from samrl_core.cell.excitation.excitation_trajectory import SETS, GainScale, gains, programme
from samrl_core.cell.excitation.runs import Run, file_runs, set_run
from samrl_core.cell.excitation.trajectory_file import ProgrammeFile

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
