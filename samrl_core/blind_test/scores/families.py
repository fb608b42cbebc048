"""Effect families of an arm, numbers 1-30 of the catalogue: what a library may hold."""

from __future__ import annotations

ARM_FAMILIES: tuple[str, ...] = (
    "coulomb_friction", "viscous_friction", "stribeck_friction", "load_dependent_friction", "presliding",
    "friction_asymmetry", "position_dependent_friction", "gear_ripple", "thermal_friction", "backlash",
    "joint_elasticity", "transmission_hysteresis", "reflected_inertia", "actuator_gain", "torque_saturation",
    "torque_rate_limit", "command_low_pass", "command_delay", "packet_jitter", "controller_gain",
    "encoder_offset", "encoder_eccentricity", "torque_sensor_error", "payload", "link_inertia", "base_tilt",
    "mount_compliance", "cable", "kinematic_error", "base_to_base",
)  # fmt: skip


def without(withheld: str) -> tuple[str, ...]:
    """The library with one family kept from it."""
    return tuple(f for f in ARM_FAMILIES if f != withheld)
