"""The joints of an arm as the simulator's arrays."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.simulation.rigid_arm import RigidArm


class JointTree:
    """Joints of an arm as arrays, parents first; a mount adds two before them, turning about x and y."""

    def __init__(self, rigid: RigidArm, mount: int) -> None:
        """Read Pinocchio's model."""
        model = rigid.model
        ids = [model.getJointId(name) for name in rigid.joints]
        arm = sorted(range(len(ids)), key=lambda i: ids[i])
        self.order = np.array(arm)  # index in the description's order of each joint of the tree
        self.mount = mount
        self.joints = mount + len(ids)
        place = {ids[i]: mount + k for k, i in enumerate(arm)}
        base = mount - 1  # the last joint of the mount, or the fixed world
        self.parent = np.array(
            [*range(-1, base), *(place.get(model.parents[ids[i]], base) for i in arm)], dtype=np.int32
        )
        placements = [model.jointPlacements[ids[i]] for i in arm]
        self.rotation = np.array([*(np.eye(3) for _ in range(mount)), *(p.rotation for p in placements)])
        self.origin = np.array([*(np.zeros(3) for _ in range(mount)), *(p.translation for p in placements)])
        axes = [rigid.screws[i][:3] if rigid.slides[i] else rigid.screws[i][3:] for i in arm]
        self.axis = np.array([*np.eye(3)[:mount], *axes])
        self.prismatic = np.array([0] * mount + [int(rigid.slides[i]) for i in arm], dtype=np.int32)
