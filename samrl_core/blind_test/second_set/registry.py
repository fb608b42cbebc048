"""The second set's families, by name."""

from __future__ import annotations

from samrl_core.blind_test.disturbances.disturbance import Disturbance
from samrl_core.blind_test.disturbances.registry import find_disturbance
from samrl_core.blind_test.second_set import body, drive, friction, sensor, transmission, unknown
from samrl_core.common.errors import InputError

_ROOMS = (friction.FAMILIES, drive.FAMILIES, transmission.FAMILIES, sensor.FAMILIES, body.FAMILIES)
SECOND_SET: dict[str, Disturbance] = {each.name: each for room in _ROOMS for each in room}
SECOND_OUTSIDE: dict[str, Disturbance] = {each.name: each for each in unknown.FAMILIES}
# Families for which physics has one formula: theirs are the catalogue's, and so are their parameters.
USUAL_FORMULA = frozenset(
    {
        "reflected_inertia",
        "actuator_gain",
        "torque_offset",
        "command_delay",
        "controller_gain",
        "encoder_offset",
        "link_inertia",
        "base_tilt",
    }
)


def find_second(name: str) -> Disturbance:
    """A family of the second set.

    Raises:
        InputError: unknown name.
    """
    known = {**SECOND_SET, **SECOND_OUTSIDE}
    if name not in known:
        raise InputError(f"unknown disturbance '{name}' of the second set; there are {sorted(known)}")
    return known[name]


def form_of(name: str) -> str:
    """T0, T1 or T2: whether its formula is the usual one, another, or that of nothing in the catalogue."""
    if find_second(name).outside:
        return "T2"
    return "T0" if name in USUAL_FORMULA else "T1"


def find_in(series: int, name: str) -> Disturbance:
    """A family of the first (1) or the second (2) set.

    Raises:
        InputError: unknown name.
    """
    return find_second(name) if series == 2 else find_disturbance(name)
