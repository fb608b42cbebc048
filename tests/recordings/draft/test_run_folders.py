"""Runs under one name in a folder each, as laboratories record them, and a model of Drake beside them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.nominal_model.read_model import read_model
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from samrl_ros.cli.diagnosis.load import load
from samrl_ros.cli.diagnosis.options import DiagnoseOptions
from samrl_ros.log_import.any_importer import import_logs_by
from samrl_ros.log_import.devices import data_folder
from samrl_ros.log_import.draft.guess import Draft, Effort
from samrl_ros.log_import.draft.joints.joint_draft import draft_mapping
from samrl_ros.log_import.draft.writing import as_yaml

# Its base is welded to a link that Drake knows and no URDF parser does.
PENDULUM = """<robot name="pendulum">
<joint name="weld" type="fixed"><parent link="world"/><child link="base"/></joint>
<link name="base"/>
<link name="rod"><inertial><origin xyz="0 0 -0.3"/><mass value="0.6"/>
<inertia ixx="0.01" iyy="0.01" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="pivot" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
<limit lower="-3.1416" upper="3.1416" effort="10" velocity="20"/></joint></robot>"""


def runs(folder: Path, *names: str) -> list[Path]:
    """A file per run, `NAME/trajectory.csv`: time, position, velocity and torque of a pendulum."""
    time = np.arange(0.0, 8.0, 0.01)
    paths = []
    for k, name in enumerate(names):
        q = 0.8 * np.sin((1.5 + k) * time)
        rate, second = np.gradient(q, time), np.gradient(np.gradient(q, time), time)
        torque = (0.01 + 0.6 * 0.3**2) * second + 0.6 * 9.81 * 0.3 * np.sin(q)
        path = folder / name / "trajectory.csv"
        path.parent.mkdir(parents=True)
        rows = np.column_stack([time, q, rate, torque])
        np.savetxt(path, rows, delimiter=",", header="time,pos_meas,vel_meas,tau_meas", comments="")
        paths.append(path)
    return paths


def drafted(paths: list[Path]) -> Draft:
    return draft_mapping(paths, PENDULUM, "pendulum.urdf", Effort.drive)


@pytest.mark.parametrize("by_folder", [False, True])
def test_each_folder_is_a_run_of_its_own(tmp_path: Path, by_folder: bool) -> None:
    paths = runs(tmp_path / "log", "143339", "143704")
    given = [tmp_path / "log"] if by_folder else paths
    draft = drafted(given)
    assert [(r["name"], r["role"]) for r in draft.recordings] == [("143339", "fit"), ("143704", "held_out")]
    assert not draft.unused
    assert not draft.questions
    mapping = tmp_path / "mapping.yaml"
    mapping.write_text(as_yaml(draft))
    (tmp_path / "log" / "pendulum.urdf").write_text(PENDULUM)
    made = import_logs_by(mapping, data_folder(draft, given[0]), (), (), None).made
    assert [len(each.recording.states.time) for each in made] == [800, 800]


def test_one_step_calls_them_by_their_folders(tmp_path: Path) -> None:
    runs(tmp_path / "log", "143339", "143704", "150101")
    (tmp_path / "pendulum.urdf").write_text(PENDULUM)
    model = read_model(tmp_path / "pendulum.urdf")
    options = DiagnoseOptions((tmp_path / "log",), urdf=tmp_path / "pendulum.urdf", effort=Effort.drive)
    fit, held_out, notes = load(options, model)
    assert [each.name for each in fit] == ["143339", "143704"]
    assert [each.name for each in held_out] == ["150101"]
    assert any(note.startswith("143704/trajectory.csv: ") for note in notes)


def test_a_folder_of_folders_with_other_files_is_no_log(tmp_path: Path) -> None:
    runs(tmp_path, "a")
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "other.csv").write_text("time,q\n0,0\n")
    with pytest.raises(InputError, match="holds no log"):
        drafted([tmp_path])


def test_a_base_on_the_world_of_drake_is_read() -> None:
    arm = RigidArm(ArmDescription("tool_arm", ("pivot",), PENDULUM, None))
    torque = arm.inverse_dynamics(np.array([[np.pi / 2]]), np.zeros((1, 1)), np.zeros((1, 1)))
    assert abs(torque[0, 0]) == pytest.approx(0.6 * 9.81 * 0.3, rel=1e-3)


def test_any_other_link_that_is_not_there_is_named() -> None:
    broken = PENDULUM.replace('<child link="rod"/>', '<child link="rodd"/>')
    with pytest.raises(InputError, match="joint 'pivot' hangs on link 'rodd'.*add <link"):
        RigidArm(ArmDescription("tool_arm", ("pivot",), broken, None))
