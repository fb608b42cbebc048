"""All disturbances by name, and how one is made to act on a recording, from some moment on if wanted."""

from __future__ import annotations

from importlib import import_module

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection
from samrl_core.blind_test.disturbances.friction.friction_forms import Gated
from samrl_core.blind_test.engines.hooks import Hooks
from samrl_core.common.errors import InputError

# A line each. Their order is a part of what a forge's seed means: a new one goes to the end of its list.
_CATALOGUE = (
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
    "drive.torque_offset",
)
_OUTSIDE = (
    "outside.quadratic_drag",
    "outside.periodic_push",
    "outside.torque_random_walk",
    "outside.detent",
    "outside.neighbour_coupling",
    "outside.moving_platform",
    "outside.coarse_torque",
    "outside.gravity_not_compensated",
    "outside.dead_phase",
    "outside.soft_stop",
    "outside.cable_snap",
)


def _load(files: tuple[str, ...]) -> dict[str, Disturbance]:
    found: dict[str, Disturbance] = {}
    for file in files:
        disturbance = import_module(f"{__package__}.{file}").DISTURBANCE
        if disturbance.name in found:
            raise InputError(
                f"{file} names its disturbance {disturbance.name!r}, as another file; rename one"
            )
        found[disturbance.name] = disturbance
    return found


CATALOGUE: tuple[str, ...] = tuple(_load(_CATALOGUE))  # families that an effect of the diagnosis may name
OUTSIDE: tuple[str, ...] = tuple(_load(_OUTSIDE))
DISTURBANCES: dict[str, Disturbance] = _load((*_CATALOGUE, *_OUTSIDE))


def find_disturbance(name: str) -> Disturbance:
    """A disturbance by name.

    Raises:
        InputError: unknown name; all known ones are listed.
    """
    if name not in DISTURBANCES:
        raise InputError(f"unknown disturbance '{name}'; known are {sorted(DISTURBANCES)}")
    return DISTURBANCES[name]


def attach(injection: Injection, onset: float | None, hooks: Hooks, rng: np.random.Generator) -> None:
    """Let a disturbance act on a recording, from `onset` [s] on.

    Raises:
        InputError: an onset for a disturbance that cannot be switched on.
    """
    if onset is None:
        injection.attach(hooks, rng)
        return
    own = Hooks()
    injection.attach(own, rng)
    filled = {name for name, value in vars(own).items() if value}
    if not filled <= {"friction", "drive", "law", "sensor"}:
        raise InputError(f"an effect on {sorted(filled)} cannot be switched on within a recording")
    for joint, elements in own.friction.items():
        for element in elements:
            hooks.add_friction(joint, Gated(element, onset))
    for stage in own.drive:
        hooks.drive.append(lambda t, u, stage=stage: stage(t, u) if t >= onset else u)
    for alter in own.law:
        hooks.law.append(lambda law, t, alter=alter: alter(law, t) if t >= onset else None)
    for sense in own.sensor:
        hooks.sensor.append(
            lambda time, tau, sense=sense: np.where((time >= onset)[:, None], sense(time, tau), tau)
        )
