from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import pytest
import yaml

from samrl_core.cell.types.arm_description import Tolerances
from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.kinds.arms import arm_trials
from samrl_ros.recordings import TOLERANCE_FILE, read_tolerances


def test_the_documented_file_is_complete_and_gives_the_defaults(tmp_path: Path) -> None:
    file = tmp_path / "tolerances.yaml"
    file.write_text(TOLERANCE_FILE)
    assert read_tolerances(file) == Tolerances()
    assert set(yaml.safe_load(TOLERANCE_FILE)) == {f.name for f in fields(Tolerances)}


def test_what_is_left_out_keeps_its_default(tmp_path: Path) -> None:
    file = tmp_path / "t.yaml"
    file.write_text("mass: 0.1\ncoulomb_friction: [0.01, 0.02]\n")
    assert read_tolerances(file) == Tolerances(mass=0.1, coulomb_friction=(0.01, 0.02))
    file.write_text("")
    assert read_tolerances(file) == Tolerances()


def test_values_per_joint_are_as_many_as_joints(motion: ArmRecording) -> None:
    """They were compared with the joints nowhere, and the diagnosis ended in a traceback."""
    few = replace(motion.arm, tolerances=Tolerances(viscous_friction=(0.01, 0.02, 0.03)))
    with pytest.raises(
        InputError, match=r"viscous_friction has 3 numbers for 7 joints \(panda_joint1, .*give one"
    ):
        arm_trials([replace(motion, arm=few)], [])
    motion.arm.tolerances.check_joints(motion.arm.joints, motion.name)


@pytest.mark.parametrize(
    "text",
    [
        "mas: 0.1",
        "mass: heavy",
        "mass: -1",
        "- 1",
        "mass: [",
        "mass: .nan",
        "mass: yes",
        "torque_offset: [0.1, true]",
    ],
)
def test_bad_files_are_refused_by_name(tmp_path: Path, text: str) -> None:
    file = tmp_path / "t.yaml"
    file.write_text(text)
    with pytest.raises(InputError, match="t.yaml"):
        read_tolerances(file)
    with pytest.raises(InputError, match="cannot read"):
        read_tolerances(tmp_path / "none.yaml")
