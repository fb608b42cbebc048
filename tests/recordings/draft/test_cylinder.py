"""A hydraulic cylinder's log, as a German test bench writes it: pressures of two chambers, no force."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.column_names import NameMeaning, meaning, words_in

LIFT = """<robot name="lift"><link name="base"/><link name="car"><inertial><mass value="480"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="boom" type="prismatic"><parent link="base"/><child link="car"/><axis xyz="0 0 1"/>
<limit lower="0" upper="0.7" effort="40000" velocity="1"/></joint></robot>"""


def test_pressures_are_left_out_aloud(tmp_path: Path) -> None:
    """It was refused: no word of it was known as a position."""
    time = np.arange(400) / 200.0
    moved = 300.0 + 150.0 * np.sin(3.0 * time)
    columns = (time, 43 + np.cos(time), 42 + np.sin(time), moved, moved + 0.4 * np.cos(3.0 * time))
    lines = ["Zeit [s];p_A [bar];p_B [bar];Weg [mm];Sollweg [mm]"]
    lines += [";".join(f"{v:.4f}".replace(".", ",") for v in row) for row in zip(*columns, strict=True)]
    (tmp_path / "messung_1.csv").write_text("\n".join(lines) + "\n")
    draft = draft_any([tmp_path / "messung_1.csv"], LIFT, None)
    states, command = draft.channels["states"], draft.channels["command"]
    named = draft.sources["states"]["columns"]
    assert named[states["position"]["formula"][0]] == "Weg [mm]" and states["position"]["unit"] == "mm"
    assert named[command["position"]["formula"][0]] == "Sollweg [mm]"
    assert "commanded_effort" not in draft.channels and not draft.questions
    told = "\n".join(draft.would_tell)
    assert "p_" in told and "a cylinder's force is the difference" in told


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("Istdrehzahl", NameMeaning("velocity", measured=True)),
        ("SollWinkel_1", NameMeaning("position", commanded=True)),
        ("bar1_angle", NameMeaning("position")),
        ("pressure_1", NameMeaning("pressure")),
    ],
)
def test_names(name: str, told: NameMeaning) -> None:
    assert meaning(name) == told


def test_other_words_are_not_cut() -> None:
    assert words_in("distance") == ["distance"] and words_in("istanbul") == ["istanbul"]
