"""What a URDF says of a joint's drive: `<dynamics friction="" damping="" armature="">`, all zero by default.

`armature` is no attribute of URDF; readers that do not know it pass it over. A model converted to URDF keeps
its rotor inertia there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from samrl_core.cell.robots.urdf_text import parse_urdf
from samrl_core.cell.types.arm_description import ArmDescription


@dataclass(frozen=True, eq=False)
class JointDynamics:
    """Nominal losses and rotor inertia of an arm's joints, in its order; arrays are not to be changed."""

    friction: np.ndarray  # (J,) Coulomb level [N m or N]
    damping: np.ndarray  # (J,) [N m s/rad or N s/m]
    armature: np.ndarray  # (J,) rotor inertia seen at the joint [kg m2 or kg]


def joint_dynamics(arm: ArmDescription) -> JointDynamics:
    """Of an arm's URDF; the controller's text, where it states armature, is the word on that.

    Raises:
        InputError: as `parse_urdf`.
    """
    rows = np.zeros((len(arm.joints), 3)) if arm.urdf is None else _of_text(arm.urdf, arm.joints)
    armature = rows[:, 2]
    if arm.controller is not None and arm.controller.armature is not None:
        armature = np.asarray(arm.controller.armature, dtype=float)
    return JointDynamics(rows[:, 0], rows[:, 1], armature)


@lru_cache(maxsize=16)
def _of_text(urdf: str, joints: tuple[str, ...]) -> np.ndarray:
    """(J, 3) friction, damping, armature."""
    rows = np.zeros((len(joints), 3))
    for joint in parse_urdf(urdf, "the URDF").findall("joint"):
        name, dynamics = joint.get("name"), joint.find("dynamics")
        if name in joints and dynamics is not None:
            rows[joints.index(name)] = [float(dynamics.get(key, 0.0)) for key in _KEYS]
    rows.setflags(write=False)
    return rows


_KEYS = ("friction", "damping", "armature")
