"""The library of effects, and every family of the contract by name.

An effect is known by its line in `_FILES`. The lines stand in the order of the contract's numbers.
"""

from __future__ import annotations

from importlib import import_module

from samrl_core.common.errors import InputError
from samrl_core.diagnosis.effects.effect import Effect
from samrl_core.diagnosis.effects.unmodelled import UNMODELLED, UnmodelledFamily

_FILES = (
    "friction.coulomb_friction",
    "friction.viscous_friction",
    "friction.stribeck_friction",
    "friction.load_dependent_friction",
    "friction.presliding",
    "friction.friction_asymmetry",
    "friction.position_dependent_friction",
    "transmission.gear_ripple",
    "friction.thermal_friction",
    "transmission.backlash",
    "transmission.joint_elasticity",
    "transmission.transmission_hysteresis",
    "drive.reflected_inertia",
    "drive.actuator_gain",
    "drive.torque_saturation",
    "drive.torque_rate_limit",
    "drive.command_low_pass",
    "drive.command_delay",
    "drive.packet_jitter",
    "drive.controller_gain",
    "sensor.encoder_offset",
    "sensor.encoder_eccentricity",
    "sensor.torque_sensor_error",
    "load.payload",
    "load.link_inertia",
    "load.base_tilt",
    "load.mount_compliance",
    "load.cable",
    "description.model_scale",
    "drive.dead_band",
)

EFFECTS: tuple[Effect, ...] = tuple(import_module(f"{__name__}.{file}").EFFECT for file in _FILES)

FAMILIES: dict[str, Effect | UnmodelledFamily] = {f.family: f for f in (*EFFECTS, *UNMODELLED)}

# Families of an arm that joint channels cannot show, and why.
NOT_BY_JOINTS: dict[str, str] = {f.family: f.reason for f in UNMODELLED if f.reason}


def find_family(name: str) -> Effect | UnmodelledFamily:
    """The effect or the unmodelled family of that name.

    Raises:
        InputError: the contract has no such family.
    """
    if name not in FAMILIES:
        raise InputError(f"unknown family of effects {name!r}; known are {', '.join(FAMILIES)}")
    return FAMILIES[name]


__all__ = ["EFFECTS", "FAMILIES", "NOT_BY_JOINTS", "Effect", "find_family"]
