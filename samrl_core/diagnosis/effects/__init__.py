"""The library of effects, and every family of the contract by name.

An effect is known by its line in `_FILES`. The lines stand in the order of the contract's numbers.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

from samrl_core.common.errors import InputError
from samrl_core.common.names import known_are
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
    "drive.torque_offset",
)

# What recorded poses show. A family that joint channels show too has a file for each.
_OF_POSES = (
    "geometry.encoder_offset",
    "geometry.kinematic_error",
    "geometry.base_to_base",
    "camera.hand_eye",
    "timing.camera_latency",
    "timing.clock_offset",
    "geometry.object_geometry",
)

# What readings against a reference show: depth against planes, stamps against another clock.
_OF_READINGS = (
    "readings.hand_eye",
    "readings.depth_scale",
    "readings.camera_latency",
    "readings.clock_offset",
)

# What tracks of free bodies show: tossed, dropped, sliding.
_OF_BODIES = (
    "bodies.base_tilt",
    "bodies.contact_friction",
    "bodies.contact_stiffness",
    "bodies.object_mass",
    "bodies.clock_offset",
    "bodies.object_geometry",
)

# What images of a known scene show.
_OF_IMAGES = (
    "images.encoder_offset",
    "images.base_to_base",
    "images.hand_eye",
    "images.intrinsics",
    "images.lens_distortion",
    "images.depth_scale",
    "images.depth_noise",
    "images.camera_latency",
    "images.clock_offset",
    "images.lighting",
    "images.object_geometry",
)


def _load(files: tuple[str, ...]) -> tuple[Effect[Any], ...]:
    return tuple(import_module(f"{__name__}.{file}").EFFECT for file in files)


EFFECTS: tuple[Effect, ...] = _load(_FILES)
POSE_EFFECTS = _load(_OF_POSES)
READING_EFFECTS = _load(_OF_READINGS)
BODY_EFFECTS = _load(_OF_BODIES)
IMAGE_EFFECTS = _load(_OF_IMAGES)
EVERY_EFFECT = (*EFFECTS, *POSE_EFFECTS, *READING_EFFECTS, *BODY_EFFECTS, *IMAGE_EFFECTS)

FAMILIES: dict[str, Effect[Any] | UnmodelledFamily] = {
    f.family: f for f in sorted((*reversed(EVERY_EFFECT), *UNMODELLED), key=lambda f: f.number)
}

# Families of an arm that joint channels cannot show, and why; recorded poses may.
NOT_BY_JOINTS: dict[str, str] = {
    "kinematic_error": "a wrong length leaves joint channels as they are; needs an external pose (camera)",
    "base_to_base": "needs both arms to see one another (camera)",
    **{f.family: f.reason for f in UNMODELLED if f.reason},
}


def find_family(name: str) -> Effect[Any] | UnmodelledFamily:
    """The effect or the unmodelled family of that name.

    Raises:
        InputError: the contract has no such family.
    """
    if name not in FAMILIES:
        raise InputError(f"unknown family of effects {name!r}; {known_are(name, FAMILIES)}")
    return FAMILIES[name]


__all__ = [
    "BODY_EFFECTS",
    "EFFECTS",
    "EVERY_EFFECT",
    "FAMILIES",
    "IMAGE_EFFECTS",
    "NOT_BY_JOINTS",
    "POSE_EFFECTS",
    "READING_EFFECTS",
    "Effect",
    "find_family",
]
