"""Placements of an arm's links against Pinocchio, sample by sample."""

import numpy as np
import pinocchio as pin
import pytest

from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm

BRANCHED = """<robot name="crane"><link name="base"/><link name="mast"/><link name="cart"/><link name="hook"/>
<link name="jib"/><link name="tool"/>
<joint name="turn" type="continuous"><parent link="base"/><child link="mast"/>
  <origin xyz="0.1 0.2 0.3" rpy="0.3 0.2 -1"/><axis xyz="1 2 -0.5"/></joint>
<joint name="slide" type="prismatic"><parent link="mast"/><child link="cart"/>
  <origin xyz="0 0.2 0.3" rpy="1 0.2 0"/><axis xyz="0 1 1"/>
  <limit lower="-1" upper="1" effort="9" velocity="2"/></joint>
<joint name="swing" type="revolute"><parent link="cart"/><child link="hook"/>
  <origin xyz="0.4 0 0" rpy="0 1.2 0"/><axis xyz="0 0 -1"/>
  <limit lower="-1" upper="1" effort="9" velocity="2"/></joint>
<joint name="nod" type="revolute"><parent link="mast"/><child link="jib"/>
  <origin xyz="0.4 0 0" rpy="0 1.2 0"/><axis xyz="0 1 0"/>
  <limit lower="-1" upper="1" effort="9" velocity="2"/></joint>
<joint name="held" type="fixed"><parent link="hook"/><child link="tool"/>
  <origin xyz="0 0 0.1" rpy="0 0 0.5"/></joint></robot>"""


@pytest.mark.parametrize(
    "joints", [("turn", "slide", "nod", "swing"), ("swing", "turn"), ("nod", "slide"), ("slide",)]
)
def test_placements_are_pinocchios(joints: tuple[str, ...]) -> None:
    """Slides, joints without an end, skew axes, branches, joints locked and in any order."""
    rigid = RigidArm(ArmDescription("arm", joints, BRANCHED, None, None))
    positions = np.random.default_rng(3).uniform(-2.0, 2.0, (20, len(joints)))
    flanges, links, twists = rigid.kinematics(positions)
    model, data = rigid.model, rigid.model.createData()
    ids = [model.getJointId(name) for name in joints]
    for k, row in enumerate(positions):
        q = np.zeros(model.nq)
        for i, angle in zip(ids, row, strict=True):
            at = model.joints[i].idx_q
            q[at : at + model.joints[i].nq] = (
                angle if model.joints[i].nq == 1 else (np.cos(angle), np.sin(angle))
            )
        pin.computeJointJacobians(model, data, q)
        jacobian = np.reshape(data.J, (6, -1))  # flat where there is one joint
        at_flange = data.oMi[rigid.flange_joint] * rigid.flange_in_joint
        np.testing.assert_allclose(flanges[k], at_flange.homogeneous, atol=1e-12)
        for j, i in enumerate(ids):
            np.testing.assert_allclose(links[k, j], data.oMi[i].homogeneous, atol=1e-12)
            np.testing.assert_allclose(twists[k, j], jacobian[:, model.joints[i].idx_v], atol=1e-12)
