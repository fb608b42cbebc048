"""MJCF in, normal form out: MuJoCo's own inverse dynamics is the judge."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from samrl_core.cell.robots.joint_dynamics import joint_dynamics
from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.nominal_model.read_model import read_model
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm

mujoco: Any = pytest.importorskip("mujoco")
JOINTS = ("shoulder", "elbow", "roll", "slide")
MODEL = """<mujoco model="odd">
  <compiler angle="radian" autolimits="true"/>
  <option timestep="0.002"/>
  <default>
    <joint damping="0.2" armature="0.01"/><position kp="200" kv="10" forcerange="-60 60"/>
  </default>
  <worldbody>
    <body name="base" pos="0 0 0.1" euler="0.1 0.2 0.3">
      <body name="upper" pos="0 0 0.1" quat="0.9 0.1 0.3 0.2">
        <joint name="shoulder" axis="0 1 0.2" pos="0.01 0.02 0.03" ref="0.3" range="-2 2" frictionloss="0.3"/>
        <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03" mass="2"/>
        <body name="fore" pos="0.3 0 0">
          <joint name="elbow" axis="0 1 0" range="-2 2"/>
          <joint name="roll" axis="1 0 0" pos="0 0.01 0"/>
          <inertial pos="0.1 0 0" mass="1" fullinertia="0.02 0.02 0.03 0.001 0.002 0.003"/>
          SHAPE
          <body name="out" pos="0.2 0 0">
            <joint name="slide" type="slide" axis="0 0 1" ref="0.05" pos="0.1 0 0"/>
            <geom size="0.03" mass="0.4" pos="0 0.1 0"/>
          </body>
        </body>
      </body>
    </body>
    <body name="cube"><freejoint/><geom size="0.02"/></body>
  </worldbody>
  <asset>ASSET</asset>
  <actuator>
    <position joint="shoulder"/><position joint="elbow"/>
    <position joint="roll" kp="30" kv="2" gear="2"/><motor joint="slide" ctrlrange="-40 40"/>
  </actuator>
</mujoco>
"""
WHOLE = MODEL.replace("SHAPE", "").replace("ASSET", "")
MESH = MODEL.replace("SHAPE", '<geom type="mesh" mesh="m"/>').replace(
    "ASSET", '<mesh name="m" file="no.stl"/>'
)


def written(folder: Path, text: str, name: str = "arm.xml") -> Path:
    """A model's file."""
    (folder / name).write_text(text)
    return folder / name


def arm_of(path: Path, joints: tuple[str, ...] = JOINTS) -> ArmDescription:
    """The arm that the diagnosis sees."""
    return ArmDescription("tool_arm", joints, read_model(path).urdf, None)


@pytest.mark.parametrize("text", [WHOLE, MESH], ids=["whole", "mesh missing"])
def test_inverse_dynamics_is_mujocos(tmp_path: Path, text: str) -> None:
    arm = arm_of(written(tmp_path, text))
    rigid, stated = RigidArm(arm), joint_dynamics(arm)
    model = mujoco.MjModel.from_xml_string(WHOLE)
    model.dof_damping[:] = model.dof_frictionloss[:] = 0.0
    model.opt.disableflags = int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    for _ in range(5):
        q, v, a = rng.normal(size=(3, 4))
        data.qpos[:4], data.qvel[:4] = q, v
        data.qacc[:], data.qacc[:4] = 0.0, a
        mujoco.mj_inverse(model, data)
        ours = rigid.inverse_dynamics(q[None], v[None], a[None])[0] + stated.armature * a
        assert np.allclose(ours, data.qfrc_inverse[:4], atol=1e-9)


def test_losses_limits_and_gains_are_nominal_values(tmp_path: Path) -> None:
    path = written(tmp_path, WHOLE)
    arm, model = arm_of(path), read_model(path)
    stated = joint_dynamics(arm)
    assert stated.friction.tolist() == [0.3, 0.0, 0.0, 0.0]
    assert stated.damping.tolist() == [0.2] * 4 and stated.armature.tolist() == [0.01] * 4
    assert RigidArm(arm).effort_limits().tolist() == [60.0, 60.0, 120.0, 40.0]  # force range, times gear
    low, high = RigidArm(arm).position_limits()
    assert low.tolist()[:3] == [-2.0, -2.0, -np.inf] and high.tolist()[:2] == [2.0, 2.0]
    assert [a.kind for a in model.actuators] == ["position"] * 3 + ["motor"]
    text = model.controller(("elbow", "roll"))
    assert text is not None
    about = json.loads(text)
    assert about["stiffness"] == [200.0, 120.0] and about["damping"] == [10.0, 8.0]  # times gear squared
    assert about["period_s"] == 0.002 and about["gravity_compensation"] is False
    assert model.controller(JOINTS) is None  # a motor has no gains
    assert any("cube moves freely" in note for note in model.notes)


def test_an_actuator_of_a_law_of_its_own_is_told(tmp_path: Path) -> None:
    odd = WHOLE.replace(
        '<motor joint="slide" ctrlrange="-40 40"/>',
        '<general name="odd" joint="slide" gainprm="5" biastype="affine" biasprm="0 -7 0"/>',
    )
    model = read_model(written(tmp_path, odd))
    assert model.actuators[-1].kind == "other"
    assert any("odd follows a law of its own" in note for note in model.notes)


def test_one_arm_of_several_is_chosen_by_its_joints(tmp_path: Path) -> None:
    """The other one is held where its reading is zero."""
    two = WHOLE.replace("</worldbody>", _second() + "</worldbody>")
    one = RigidArm(arm_of(written(tmp_path, WHOLE)))
    both = arm_of(written(tmp_path, two, "two.xml"))
    q, zero = np.array([[0.3, -0.4, 0.5, 0.02]]), np.zeros((1, 4))
    assert np.allclose(RigidArm(both).gravity(q), one.gravity(q), atol=1e-12)
    other = arm_of(tmp_path / "two.xml", ("left",))
    assert np.allclose(RigidArm(other).inverse_dynamics(q[:, :1] * 0, zero[:, :1], zero[:, :1]), 0.2 * 9.81)


def _second() -> str:
    return """<body name="left_link" pos="0 1 0"><joint name="left" axis="0 -1 0"/>
      <inertial pos="0.2 0 0" mass="1" diaginertia="0.01 0.01 0.01"/></body>"""


def test_included_files_become_one_text(tmp_path: Path) -> None:
    written(tmp_path, '<mujocoinclude><default><joint damping="0.7"/></default></mujocoinclude>', "part.xml")
    path = written(
        tmp_path,
        '<mujoco><include file="part.xml"/><worldbody><body><joint name="j"/><geom size="0.1"/></body>'
        "</worldbody></mujoco>",
    )
    model = read_model(path)
    assert joint_dynamics(ArmDescription("tool_arm", ("j",), model.urdf, None)).damping.tolist() == [0.7]
    assert "<include" not in model.source
    assert mujoco.MjModel.from_xml_string(model.source).dof_damping.tolist() == [0.7]


@pytest.mark.parametrize(
    "text, said",
    [
        ("<mujoco><worldbody>\n<body nam='a'/></worldbody></mujoco>", r"arm\.xml.*'nam'.*line 2.*mend"),
        ("<mujoco><worldbody><body></worldbody></mujoco>", r"arm\.xml.*mend the model"),
        (re.sub("<inertial.*", "", MESH), r"body 'fore' has its mass from the mesh 'no\.stl'.*<inertial>"),
        ("<sdf/>", r"starts with <sdf>; give a URDF or xacro \(<robot>\) or an MJCF"),
        ("kp = 3", r"is no XML.*give a URDF"),
    ],
)  # fmt: skip
def test_a_bad_model_is_refused_with_its_place_and_a_remedy(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_model(written(tmp_path, text))
