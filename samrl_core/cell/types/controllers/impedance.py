"""Joint impedance: the law of torque-controlled arms, and the contract's first."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from samrl_core.cell.types.arm_description import ArmController
from samrl_core.cell.types.controllers.kind import ENCODER, ControllerKind, Gains, Key
from samrl_core.cell.types.drive_law import DriveLaw


class JointImpedance(ControllerKind):
    """Spring and damper to the command, on top of gravity."""

    name = "joint_impedance"
    title = "Joint impedance"
    formula = "u = clip(K (q_d - q) + D (dq_d - dq) + g(q) + feed-forward); torque u"
    source = "Hogan 1985, Impedance control; libfranka's joint impedance example"
    keys = (
        Key("stiffness", "N m/rad", "K"),
        Key("damping", "N m s/rad", "D"),
    )
    choices = ENCODER
    compensates = True

    def gains(self, values: Mapping[str, np.ndarray], words: Mapping[str, str]) -> Gains:
        """As the formula says."""
        return Gains(DriveLaw(encoder=words["encoder"]), values["stiffness"], values["damping"])

    def describe(self, controller: ArmController) -> dict[str, Any]:
        """From the gains themselves: excitation runs scale them."""
        own: dict[str, Any] = {
            "stiffness": np.asarray(controller.stiffness).tolist(),
            "damping": np.asarray(controller.damping).tolist(),
        }
        if controller.law.encoder != ENCODER["encoder"][0]:
            own["encoder"] = controller.law.encoder
        for name in ("effort_limit", "armature"):
            if getattr(controller, name) is not None:
                own[name] = np.asarray(getattr(controller, name)).tolist()
        return own
