"""Excitation trajectories: motions that make a robot show what its model leaves out."""

from __future__ import annotations

from samrl_core.cell.excitation.catalogue import KINDS
from samrl_core.cell.excitation.excitation_trajectory import SETS, GainScale, gains, make_trajectory
from samrl_core.cell.excitation.runs import Run, file_runs, set_run
from samrl_core.cell.excitation.trajectory_file import TrajectoryFile

__all__ = [
    "KINDS",
    "SETS",
    "GainScale",
    "TrajectoryFile",
    "Run",
    "file_runs",
    "gains",
    "make_trajectory",
    "set_run",
]
