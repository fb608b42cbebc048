"""A file for what was measured and one for what was commanded: topics of one recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_ros.log_import.any_importer import import_logs_by
from samrl_ros.log_import.devices import data_folder
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.guess import Draft, Effort
from samrl_ros.log_import.draft.writing import as_yaml
from samrl_ros.log_import.foreign import runs_in

PENDULUM = """<robot name="p"><link name="base"/><link name="rod"><inertial><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="pivot" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="10" velocity="20"/></joint></robot>"""
ECHOED = """header:
  stamp:
    sec: {sec}
    nanosec: {nanosec}
  frame_id: ''
name:
- pivot
position:
- {q:.6f}
velocity: []
effort: []
---
"""


def pair(folder: Path, *names: str, begin: float = 0.0) -> Path:
    """Tables of one motion with the same columns; every other one 20 ms ahead of the first."""
    time = begin + np.arange(0.0, 2.0, 0.01)
    folder.mkdir(parents=True, exist_ok=True)
    for k, name in enumerate(names):
        rows = np.column_stack([time, np.sin(3.0 * (time - begin + 0.02 * (k % 2)))])
        np.savetxt(folder / name, rows, delimiter=",", header="time,pivot_pos_rad", comments="")
    return folder


def drafted(*paths: Path) -> Draft:
    return draft_any(paths, PENDULUM, "pendulum.urdf", Effort.none)


@pytest.mark.parametrize(
    ("measured", "commanded"),
    [("measured_js.csv", "setpoint_js.csv"), ("joint_states.csv", "cmd.csv"), ("actual.csv", "desired.csv")],
)
def test_both_are_one_recording(tmp_path: Path, measured: str, commanded: str) -> None:
    draft = drafted(pair(tmp_path / "run", measured, commanded))
    files = {name: source["file"] for name, source in draft.sources.items()}
    assert files == {"states": measured, "command": commanded}
    assert [each["role"] for each in draft.recordings] == ["fit"]


@pytest.mark.parametrize("by_folder", [True, False])
def test_echoed_topics_are_one_recording(tmp_path: Path, by_folder: bool) -> None:
    time = 1.7e9 + np.arange(0.0, 1.5, 0.02)
    for k, name in enumerate(("measured_js.yaml", "setpoint_js.yaml")):
        messages = (
            ECHOED.format(sec=int(t), nanosec=int((t % 1) * 1e9), q=np.sin(3.0 * (t - time[0]) + 0.05 * k))
            for t in time
        )
        (tmp_path / name).write_text("".join(messages))
    draft = drafted(*([tmp_path] if by_folder else sorted(tmp_path.iterdir())))
    assert draft.sources["command"]["file"] == "setpoint_js.yaml"
    assert len(draft.recordings) == 1


@pytest.mark.parametrize("by_folder", [True, False])
def test_each_folder_with_both_is_a_recording(tmp_path: Path, by_folder: bool) -> None:
    log = tmp_path / "log"
    folders = [pair(log / name, "measured.csv", "setpoint.csv") for name in ("trial1", "trial2", "trial3")]
    paths = [log] if by_folder else [file for folder in folders for file in sorted(folder.iterdir())]
    draft = drafted(*paths)
    assert draft.sources["states"]["file"] == "{name}/measured.csv"
    assert draft.sources["command"]["file"] == "{name}/setpoint.csv"
    roles = {each["name"]: each["role"] for each in draft.recordings}
    assert roles == {"trial1": "fit", "trial2": "fit", "trial3": "held_out"}
    (log / "pendulum.urdf").write_text(PENDULUM)
    (tmp_path / "mapping.yaml").write_text(as_yaml(draft))
    made = import_logs_by(tmp_path / "mapping.yaml", data_folder(draft, paths[0]), (), (), None).made
    assert [each.recording.command is not None for each in made] == [True, True, True]
    assert runs_in(log) == folders


def test_folders_of_other_columns_are_no_recordings_of_one_machine(tmp_path: Path) -> None:
    for name in ("a", "b"):
        pair(tmp_path / name, "measured.csv", "setpoint.csv")
    table = tmp_path / "b" / "setpoint.csv"
    table.write_text(table.read_text().replace("pivot_pos_rad", "elbow_pos_rad"))
    with pytest.raises(InputError, match=r"b/setpoint.csv and .*same columns.*take one of them out"):
        drafted(tmp_path)


def test_files_of_other_times_are_recordings(tmp_path: Path) -> None:
    pair(tmp_path, "actual_load.csv")
    pair(tmp_path, "desired_load.csv", begin=60.0)
    assert [each["role"] for each in drafted(tmp_path).recordings] == ["fit", "held_out"]


def test_pairs_side_by_side_are_to_be_told_apart(tmp_path: Path) -> None:
    """Four files of the same columns were four recordings, two of them of commands."""
    pair(tmp_path, "run1_measured.csv", "run1_setpoint.csv", "run2_measured.csv", "run2_setpoint.csv")
    with pytest.raises(InputError, match="run1_measured.csv and run1_setpoint.csv .*a folder of its own"):
        drafted(tmp_path)


def test_folders_of_several_logs_say_which_to_name(tmp_path: Path) -> None:
    for name in ("a", "b"):
        pair(tmp_path / name, "x.csv", "y.csv")
    with pytest.raises(InputError, match=r"Name the folder of one recording, such as .*/a"):
        drafted(tmp_path)
