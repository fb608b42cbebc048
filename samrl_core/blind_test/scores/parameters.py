"""Which stated parameter of an effect is which true one: forge and diagnosis were written apart."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

_Values = Mapping[str, float]
# Family to stated name to what it is of the label's values. Equal names need no entry. What is parametrised
# unlike (a link's mass error against its first moment, say) is left out of the coverage rather than guessed.
_SAME: dict[str, dict[str, Callable[[_Values], float]]] = {
    "friction_asymmetry": {
        "mean": lambda p: (p["forward"] + p["backward"]) / 2.0,
        "difference": lambda p: (p["forward"] - p["backward"]) / 2.0,
    },
    # Of its first harmonic; the second one nobody asks for.
    "position_dependent_friction": {
        "amplitude": lambda p: 0.35 * p["swing"],
        "order": lambda p: p["harmonic"],
        "level": lambda p: 0.5 * p["swing"],
    },
    "load_dependent_friction": {"Kb": lambda p: p["Kl"] * p.get("back_driving", 1.0)},
    # The label's ripple is added to the drive's torque, the stated one is lost from it.
    "gear_ripple": {
        "amplitude": lambda p: p["A"],
        "order": lambda p: p["N"],
        "phase": lambda p: p["phi"] + math.pi,
    },
    "backlash": {"b": lambda p: p["half_width"]},
    "transmission_hysteresis": {"a": lambda p: p["loop_width"] / 2.0},
    "reflected_inertia": {"Ja": lambda p: p["J"]},
    "torque_saturation": {"L": lambda p: p["limit"]},
    "torque_rate_limit": {"R": lambda p: p["rate"]},
    "packet_jitter": {"held": lambda p: p["share"]},
    "controller_gain": {"eK": lambda p: p["stiffness_error"], "eD": lambda p: p["damping_error"]},
    "payload": {
        "mass": lambda p: p["m"],
        "com_x": lambda p: p["cx"],
        "com_y": lambda p: p["cy"],
        "com_z": lambda p: p["cz"],
    },
    "mount_compliance": {"damping": lambda p: p["damping_ratio"]},
    "cable": {"h": lambda p: p["loop"]},
}
_ANGLES = ("phi", "phase")  # the same after a whole turn


def comparable(
    family: str, stated: Mapping[str, Any], true: Mapping[str, Any]
) -> list[tuple[str, Any, float]]:
    """(name, stated estimate, true value) of scalar parameters with an interval.

    Parameters of equal name must have equal units; an angle's truth is turned to the estimate's side.
    """
    values = {
        name: float(known["value"])
        for name, known in true.items()
        if isinstance(known, dict) and isinstance(known.get("value"), int | float)
    }
    pairs = []
    for name, estimate in stated.items():
        if None in (estimate.get("ci95") or (None, None)):
            continue
        translate = _SAME.get(family, {}).get(name)
        if translate is not None:
            try:
                value = translate(values)
            except KeyError:  # the label of another form
                continue
        elif name in values and _unit(true[name]) == _unit(estimate):
            value = values[name]
        else:
            continue
        if name in _ANGLES:
            value += math.tau * round((float(estimate["value"]) - value) / math.tau)
        pairs.append((name, estimate, value))
    return pairs


def _unit(quantity: Mapping[str, Any]) -> str:
    """Radians are pure numbers where something is counted per angle."""
    return {"1/rad": "1"}.get(str(quantity.get("unit")), str(quantity.get("unit")))
