"""What a world refuses to be commanded."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.robots.robot import ROLES
from samrl_core.cell.types.observation import ArmCommand
from samrl_core.common.errors import InputError


def checked_role(role: str) -> str:
    """The role itself.

    Raises:
        InputError: it is none of the cell's.
    """
    if role not in ROLES:
        raise InputError(f"no arm has the role {role!r}; there are: {', '.join(ROLES)}")
    return role


def checked_command(command: ArmCommand, joints: int) -> ArmCommand:
    """The command itself.

    Raises:
        InputError: a field has not `joints` finite numbers.
    """
    for name in ("position", "velocity", "acceleration", "effort"):
        value = getattr(command, name)
        if value.shape != (joints,) or not np.isfinite(value).all():
            raise InputError(f"command's {name} is {value}, must be {joints} finite numbers")
    return command


def holding(position: np.ndarray, stamp_ns: int) -> ArmCommand:
    """The command to stay at `position` (J,) [rad]."""
    zero = np.zeros_like(position)
    return ArmCommand(stamp_ns, position.copy(), zero, zero, zero)
