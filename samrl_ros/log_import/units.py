"""Units a mapping may state, as factors to SI.

A closed list, not pint: pint takes angles as plain numbers (a position in `percent` would pass), reads `Nm`
as metres per kilogram, and knows neither `rev` nor `deg/s2`.
"""

from __future__ import annotations

import math
import re

import numpy as np

from samrl_core.cell.types.drive_law import DriveLaw
from samrl_core.common.errors import InputError

_ANGLE = {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180, "rev": 2 * math.pi}
_LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6}
_EFFORT = {"N m": 1.0, "Nm": 1.0, "mN m": 1e-3, "kN m": 1e3, "N cm": 1e-2, "N": 1.0, "mN": 1e-3, "kN": 1e3}
_DRIVE = {"V": 1.0, "mV": 1e-3, "A": 1.0, "mA": 1e-3, "duty": 1.0}  # then times what the controller states
_POSITION = _ANGLE | _LENGTH
UNITS: dict[str, dict[str, float]] = {
    "position": _POSITION,
    "velocity": {f"{u}/s": f for u, f in _POSITION.items()} | {"rpm": math.pi / 30},
    "acceleration": {f"{u}/s2": f for u, f in _POSITION.items()},
    "effort": _EFFORT | _DRIVE | {"raw": 1.0},
    "enabled": {"1": 1.0},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
}
SI = {
    "position": "rad or m",
    "velocity": "rad/s or m/s",
    "acceleration": "rad/s2 or m/s2",
    "effort": "N m or N",
    "enabled": "1 on, 0 off",
}
DEFAULT_UNIT = {
    "position": "rad",
    "velocity": "rad/s",
    "acceleration": "rad/s2",
    "effort": "N m",
    "enabled": "1",
}
_COUNTS = re.compile(r"^counts/(\d+(?:\.\d+)?)(/s2|/s)?$")  # counts of so many per revolution
_COUNTS_OF = {"position": None, "velocity": "/s", "acceleration": "/s2"}


def drive_factor(unit: str | None, law: DriveLaw | None, joints: int, where: str) -> np.ndarray:
    """Torque (J,) [N m] per volt, ampere or full duty by the described motor; ones for other units.

    Raises:
        InputError: a motor's unit without a motor that is described, or one that `effort_from` contradicts.
    """
    if unit not in _DRIVE:
        return np.ones(joints)
    by_current = unit.endswith("A")
    name = "torque_per_ampere" if by_current else "torque_per_volt"
    told = np.zeros(joints) if law is None else law.of_joints(name, joints)
    of = told if law is None or unit != "duty" else told * law.of_joints("most_volt", joints)
    # A joint without a motor has no torque of it, whatever was recorded there.
    if law is None or not (told > 0).any() or not (of[told > 0] > 0).all():
        raise InputError(
            f"{where}: unit {unit} needs a controller that states {name.replace('_', ' ')}"
            f"{' and voltage_limit' if unit == 'duty' else ''}: a type with the motor's keys"
        )
    if by_current != law.after_back_emf and not law.open_loop:
        raise InputError(
            f"{where}: unit {unit} contradicts controller.effort_from; say"
            f" effort_from: {'current' if by_current else 'voltage'}"
        )
    return of


def factor(quantity: str, unit: str | None, where: str) -> float:
    """Factor from `unit` (None: SI) to SI. Raises `InputError` listing the units of the quantity."""
    known = UNITS[quantity]
    if unit is None:
        return 1.0
    if unit in known:
        return known[unit]
    counts = _COUNTS.match(unit)
    if counts and quantity in _COUNTS_OF and counts[2] == _COUNTS_OF[quantity] and float(counts[1]) > 0:
        return 2 * math.pi / float(counts[1])
    extra = f", or counts/N{_COUNTS_OF[quantity] or ''} (N per revolution)" if quantity in _COUNTS_OF else ""
    raise InputError(
        f"{where}: unit {unit!r} is unknown for {quantity}; use one of {', '.join(known)}{extra}"
    )
