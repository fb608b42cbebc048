"""Joints that the description does not list are held, whatever the URDF calls its links."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from tests.diagnosis.simulation.arms import TREE


def test_links_may_be_called_as_their_joints() -> None:
    """As ANYmal's legs are; Pinocchio alone gives up."""
    alike = TREE
    for link, joint in (("trunk", "turn"), ("left", "left_arm"), ("right", "right_arm")):
        alike = alike.replace(f'"{link}"', f'"{joint}"')
    listed = ("turn", "left_arm")
    plain = RigidArm(ArmDescription("tool_arm", listed, TREE, None))
    named = RigidArm(ArmDescription("tool_arm", listed, alike, None))
    np.testing.assert_allclose(named.inertial_parameters, plain.inertial_parameters, atol=1e-12)
    assert plain.links == ("trunk", "left")
    assert named.links == listed
    assert (plain.flange, named.flange) == ("left", "left_arm")
