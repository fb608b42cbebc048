"""What a URDF says of a joint in `<dynamics friction damping armature stiffness springref>`; zero by default.

The last three are no attributes of URDF; readers that do not know them pass them over. A model converted to
URDF keeps its rotor inertia and its springs there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from samrl_core.cell.robots.urdf_text import parse_urdf
from samrl_core.cell.types.arm_description import ArmDescription


@dataclass(frozen=True, eq=False)
class JointDynamics:
    """Nominal losses, rotors and springs of an arm's joints, in its order; arrays are not to be changed."""

    friction: np.ndarray  # (J,) Coulomb level [N m or N]
    damping: np.ndarray  # (J,) [N m s/rad or N s/m]
    armature: np.ndarray  # (J,) rotor inertia seen at the joint [kg m2 or kg]
    stiffness: np.ndarray  # (J,) of a spring at the link [N m/rad or N/m]
    spring_rest: np.ndarray  # (J,) where it pulls nothing [rad or m]


def joint_dynamics(arm: ArmDescription) -> JointDynamics:
    """Of an arm's URDF; the controller's text, where it states armature, is the word on that.

    Raises:
        InputError: as `parse_urdf`.
    """
    rows = np.zeros((len(arm.joints), len(_KEYS))) if arm.urdf is None else _of_text(arm.urdf, arm.joints)
    armature = rows[:, 2]
    if arm.controller is not None and arm.controller.armature is not None:
        armature = np.asarray(arm.controller.armature, dtype=float)
    return JointDynamics(rows[:, 0], rows[:, 1], armature, rows[:, 3], rows[:, 4])


@lru_cache(maxsize=16)
def _of_text(urdf: str, joints: tuple[str, ...]) -> np.ndarray:
    """(J, 5) as `_KEYS`."""
    rows = np.zeros((len(joints), len(_KEYS)))
    for joint in parse_urdf(urdf, "the URDF").findall("joint"):
        name, dynamics = joint.get("name"), joint.find("dynamics")
        if name in joints and dynamics is not None:
            rows[joints.index(name)] = [float(dynamics.get(key, 0.0)) for key in _KEYS]
    rows.setflags(write=False)
    return rows


_KEYS = ("friction", "damping", "armature", "stiffness", "springref")
