from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import pytest
import yaml

from samrl_core.cell.types.arm_description import Tolerances
from samrl_core.common.errors import InputError
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


@pytest.mark.parametrize("text", ["mas: 0.1", "mass: heavy", "mass: -1", "- 1", "mass: [", "mass: .nan"])
def test_bad_files_are_refused_by_name(tmp_path: Path, text: str) -> None:
    file = tmp_path / "t.yaml"
    file.write_text(text)
    with pytest.raises(InputError, match="t.yaml"):
        read_tolerances(file)
    with pytest.raises(InputError, match="cannot read"):
        read_tolerances(tmp_path / "none.yaml")
