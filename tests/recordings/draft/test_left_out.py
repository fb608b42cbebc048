"""A motor's current is asked about; in one step it is left out, aloud."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.guess import Effort
from samrl_ros.log_import.foreign import read_runs

NAMES = ("Time [ms]", "SetPos [mm]", "ActPos [mm]", "ActCurrent [A]")
AXIS = """<robot name="axis"><link name="base"/><link name="table"><inertial><mass value="25"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="x" type="prismatic"><parent link="base"/><child link="table"/><axis xyz="1 0 0"/>
<limit lower="-1" upper="1" effort="6900" velocity="1"/></joint></robot>"""


def scope(path: Path) -> Path:
    """A drive's trace, decimal commas, behind four lines of its own."""
    time = np.arange(400) / 200.0
    moved = 80.0 * np.sin(3.0 * time)
    rows = zip(1e3 * time, moved, moved - 0.1 * np.cos(3.0 * time), np.cos(3.0 * time), strict=True)
    lines = ["Name;Scope", "File;scope_1", "", ";".join(NAMES)]
    lines += [";".join(f"{value:.4f}".replace(".", ",") for value in row) for row in rows]
    path.write_text("\n".join(lines) + "\n", encoding="cp1252")
    return path


def test_a_current_is_left_out_aloud(tmp_path: Path) -> None:
    log = scope(tmp_path / "scope_1.csv")
    assert "torque constant" in draft_any([log], AXIS, None).questions[0]
    draft = draft_any([log], AXIS, None, Effort.none)
    (told,) = draft.would_tell
    assert told.startswith("scope_1.csv: ActCurrent [A]: multiply by torque constant and gear ratio")
    assert not draft.questions
    _, notes = read_runs(log, AXIS, None, Effort.ask)
    assert f"left out: {told}" in notes
