"""All families by name, and how one is made to act on a recording, from some moment on if wanted."""

from __future__ import annotations

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Effect, Family
from samrl_core.blind_test.disturbances.drive import (
    actuator_gain,
    command_delay,
    command_low_pass,
    controller_gain,
    packet_jitter,
    reflected_inertia,
    torque_rate_limit,
    torque_saturation,
)
from samrl_core.blind_test.disturbances.friction import (
    coulomb_friction,
    friction_asymmetry,
    load_dependent_friction,
    position_dependent_friction,
    presliding,
    stribeck_friction,
    thermal_friction,
    viscous_friction,
)
from samrl_core.blind_test.disturbances.friction.friction_forms import Gated
from samrl_core.blind_test.disturbances.load import base_tilt, cable, link_inertia, mount_compliance, payload
from samrl_core.blind_test.disturbances.outside import (
    cable_snap,
    coarse_torque,
    dead_phase,
    detent,
    gravity_not_compensated,
    moving_platform,
    neighbour_coupling,
    periodic_push,
    quadratic_drag,
    soft_stop,
    torque_random_walk,
)
from samrl_core.blind_test.disturbances.sensor import (
    encoder_eccentricity,
    encoder_offset,
    torque_sensor_error,
)
from samrl_core.blind_test.disturbances.transmission import (
    backlash,
    gear_ripple,
    joint_elasticity,
    transmission_hysteresis,
)
from samrl_core.blind_test.engines.hooks import Hooks
from samrl_core.common.errors import InputError

_CATALOGUE = (
    coulomb_friction,
    viscous_friction,
    stribeck_friction,
    load_dependent_friction,
    presliding,
    friction_asymmetry,
    position_dependent_friction,
    gear_ripple,
    thermal_friction,
    backlash,
    joint_elasticity,
    transmission_hysteresis,
    reflected_inertia,
    actuator_gain,
    torque_saturation,
    torque_rate_limit,
    command_low_pass,
    command_delay,
    packet_jitter,
    controller_gain,
    encoder_offset,
    encoder_eccentricity,
    torque_sensor_error,
    payload,
    link_inertia,
    base_tilt,
    mount_compliance,
    cable,
)
_OUTSIDE = (
    quadratic_drag,
    periodic_push,
    torque_random_walk,
    detent,
    neighbour_coupling,
    moving_platform,
    coarse_torque,
    gravity_not_compensated,
    dead_phase,
    soft_stop,
    cable_snap,
)

FAMILIES: dict[str, Family] = {m.FAMILY.name: m.FAMILY for m in (*_CATALOGUE, *_OUTSIDE)}
CATALOGUE: tuple[str, ...] = tuple(m.FAMILY.name for m in _CATALOGUE)  # numbers 1..28 in order
OUTSIDE: tuple[str, ...] = tuple(m.FAMILY.name for m in _OUTSIDE)


def family(name: str) -> Family:
    """A family by name.

    Raises:
        InputError: unknown name; all known ones are listed.
    """
    if name not in FAMILIES:
        raise InputError(f"unknown disturbance '{name}'; known are {sorted(FAMILIES)}")
    return FAMILIES[name]


def attach(effect: Effect, onset: float | None, hooks: Hooks, rng: np.random.Generator) -> None:
    """Let an effect act on a recording, from `onset` [s] on.

    Raises:
        InputError: an onset for an effect that cannot be switched on.
    """
    if onset is None:
        effect.attach(hooks, rng)
        return
    own = Hooks()
    effect.attach(own, rng)
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
