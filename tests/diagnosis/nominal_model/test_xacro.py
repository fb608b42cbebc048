"""xacro in, URDF out: arguments, packages beside the file, and errors that say where."""

from __future__ import annotations

from pathlib import Path

import pytest

from samrl_core.common.errors import InputError
from samrl_core.diagnosis.nominal_model.from_xacro import expand
from samrl_core.diagnosis.nominal_model.read_model import read_model

FILE = """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="prefix" default="left"/>
  <xacro:include filename="$(find my_parts)/link.xacro"/>
  <link name="base"/>
  <xacro:part name="$(arg prefix)_arm" mass="$(arg mass)"/>
</robot>
"""
PART = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:macro name="part" params="name mass">
    <link name="${name}"><inertial><mass value="${2 * mass}"/>
      <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
      <visual><geometry><mesh filename="package://nowhere/x.stl"/></geometry></visual></link>
    <joint name="${name}_joint" type="revolute"><parent link="base"/><child link="${name}"/>
      <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="5" velocity="1"/>
      <dynamics friction="0.2" damping="0.1"/></joint>
  </xacro:macro>
</robot>
"""


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    """A xacro file with a package beside its own folder."""
    (tmp_path / "my_parts").mkdir()
    (tmp_path / "my_parts" / "package.xml").write_text("<package><name>my_parts</name></package>")
    (tmp_path / "my_parts" / "link.xacro").write_text(PART)
    (tmp_path / "urdf").mkdir()
    path = tmp_path / "urdf" / "arm.urdf.xacro"
    path.write_text(FILE)
    return path


def test_arguments_and_packages_without_ros(arm: Path) -> None:
    model = read_model(arm, {"mass": "1.5", "prefix": "right"})
    assert model.form == "xacro" and '<joint name="right_arm_joint"' in model.urdf
    assert '<mass value="3.0"/>' in model.urdf and "xacro:" not in model.urdf.replace("xmlns:xacro", "")


def test_a_missing_argument_is_asked_for(arm: Path) -> None:
    with pytest.raises(InputError, match=r"arm\.urdf\.xacro.*mass.*--xacro-arg NAME:=VALUE"):
        read_model(arm)


def test_a_missing_package_is_named(arm: Path) -> None:
    arm.write_text(FILE.replace("my_parts", "her_parts"))
    with pytest.raises(InputError, match=r"her_parts.*is not found.*source ROS"):
        read_model(arm, {"mass": "1"})


def test_an_error_names_the_included_file(arm: Path) -> None:
    (arm.parent.parent / "my_parts" / "link.xacro").write_text(PART.replace("2 * mass", "2 * weight"))
    with pytest.raises(InputError, match=r"weight"):
        read_model(arm, {"mass": "1"})


def test_arguments_of_a_plain_urdf_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text('<robot name="a"><link name="base"/></robot>')
    with pytest.raises(InputError, match=r"is no xacro file.*mass"):
        read_model(path, {"mass": "1"})


def test_an_expression_that_does_not_end_is_refused(arm: Path) -> None:
    arm.write_text(FILE.replace("$(arg mass)", "${9 ** 9 ** 9}"))
    with pytest.raises(InputError, match=r"arm\.urdf\.xacro: xacro has not expanded it within 1 s"):
        expand(arm, {}, longest_s=1)


def test_an_expression_that_takes_all_memory_is_refused(arm: Path) -> None:
    arm.write_text(FILE.replace("$(arg mass)", "${[1] * 10 ** 10}"))
    with pytest.raises(InputError, match=r"cannot be expanded: when evaluating expression .\[1\] \* 10"):
        expand(arm, {})
