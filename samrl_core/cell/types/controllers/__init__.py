"""Kinds of controllers, by the `type` of their text: one file per make of drive, one common law behind them.

A kind states its keys in the terms of its data sheet and turns them into the two gains of `ArmController` and
the numbers of `DriveLaw`. Equations and simulator know only that law; a new kind is a new line in `KINDS`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from samrl_core.cell.types.arm_description import ArmController
from samrl_core.cell.types.controllers.impedance import JointImpedance
from samrl_core.cell.types.controllers.kind import ControllerKind, Key, joint_names
from samrl_core.cell.types.controllers.motors import CurrentMotor, VoltageMotor
from samrl_core.cell.types.controllers.servos import PositionServo, VelocityDrive, VoltageServo
from samrl_core.cell.types.controllers.stepper import Stepper
from samrl_core.common.errors import InputError

KINDS: dict[str, ControllerKind] = {
    kind.name: kind
    for kind in (
        JointImpedance(), PositionServo(), VoltageServo(), VelocityDrive(), VoltageMotor(), CurrentMotor(),
        Stepper(),
    )
}  # fmt: skip


def controller_from(about: Mapping[str, Any], where: str = "controller") -> ArmController:
    """The controller that the contract's JSON object describes; `type` names its kind.

    Raises:
        InputError: an unknown type, a missing key, or numbers that do not fit the joints.
    """
    name = about.get("type", JointImpedance.name)
    if name not in KINDS:
        raise InputError(f"{where}: type is {name!r}; known are {', '.join(KINDS)}")
    return KINDS[name].read(about, joint_names(about.get("joints", []), where), where)


__all__ = ["KINDS", "ControllerKind", "Key", "controller_from", "joint_names"]
