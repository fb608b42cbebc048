"""One border for every description of a robot: text in, one normal form out.

The normal form is a URDF, because everything behind the border reads one: the joint tree with inertias,
limits, and `<dynamics friction damping armature>` as nominal losses and rotors. What a URDF cannot hold,
the gains of the model's actuators, stands beside it. The original text is kept: a correction is written
into that, not into ours.

No geometry is needed for dynamics, so a missing mesh is no error; only a body that would get its mass from
one is.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.cell.types.arm_description import ArmController


@dataclass(frozen=True)
class JointActuator:
    """What a model's actuator does at its joint: effort = stiffness (q_d - q) + damping (dq_d - dq)."""

    joint: str
    kind: str  # position, velocity, motor or other
    stiffness: float = 0.0  # [N m/rad]
    damping: float = 0.0  # [N m s/rad]
    effort_limit: float = np.inf  # [N m]


@dataclass(frozen=True)
class NominalModel:
    """A robot's description."""

    form: str  # urdf, xacro or mjcf
    path: Path | None  # None where it came as text
    source: str  # as its files hold it, included files and macros written out
    urdf: str  # normal form
    actuators: tuple[JointActuator, ...] = ()
    period_s: float = ArmController.period_s  # of the model's own time step
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)  # in the model's world [m/s2]
    compensated: bool = False  # whether the model takes gravity off its bodies
    notes: tuple[str, ...] = ()

    def controller(self, joints: Sequence[str]) -> str | None:
        """The contract's JSON of the controller that the model's actuators make; None where they make none.

        A position actuator is a joint impedance, without gravity compensation unless the model takes it off.
        """
        by_joint = {a.joint: a for a in self.actuators}
        found = [by_joint.get(name) for name in joints]
        if not found or any(a is None or a.kind != "position" for a in found):
            return None
        these = [a for a in found if a is not None]
        about: dict[str, Any] = {
            "type": "joint_impedance",
            "joints": list(joints),
            "stiffness": [a.stiffness for a in these],
            "damping": [a.damping for a in these],
            "gravity_compensation": self.compensated,
            "period_s": self.period_s,
            "gravity": list(self.gravity),
        }
        if all(np.isfinite(a.effort_limit) for a in these):
            about["effort_limit"] = [a.effort_limit for a in these]
        return json.dumps(about)
