"""Everything by which a real arm may differ from its nominal model, neutral by default."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from samrl_core.common.errors import InputError

Value = float | np.ndarray | tuple[float, ...]
_INF = float("inf")


def _joint(default: float, unit: str, text: str, low: float = -_INF, positive: bool = False) -> Any:
    """A field with one value for all joints or one per joint."""
    return field(
        default=default,
        metadata={"unit": unit, "text": text, "low": low, "positive": positive, "kind": "joint"},
    )


@dataclass(frozen=True, eq=False)
class PlantParameters:
    """One plant. Joint fields are one number or an array (J,) in the description's joint order; SI units.

    For prismatic joints read m for rad and N for N m. q, dq are a joint's position and velocity, u the
    commanded effort, tau the torque through the transmission, h the controller's period.

    A part that is not there at all has no derivative there: joint_stiffness at infinity, backlash at 0,
    presliding_stiffness at 0, mount_stiffness at infinity, effort_limit and effort_rate_limit where they do
    not bind. encoder_resolution, hold_probability and seed never have one, nor stribeck_exponent at 0.

    Raises:
        InputError: a value that is not finite (infinity is allowed where it is neutral), or below its bound.
    """

    # reading
    encoder_offset: Value = _joint(0.0, "rad", "reading = q + offset")
    encoder_amplitude: Value = _joint(0.0, "rad", "reading += amplitude sin(q + phase), once per revolution")
    encoder_phase: Value = _joint(0.0, "rad", "phase of encoder_amplitude")
    encoder_resolution: Value = _joint(0.0, "rad", "reading rounded to multiples; 0 is off", 0.0)
    # command and controller
    stiffness_scale: Value = _joint(1.0, "1", "controller's K times this", 0.0)
    damping_scale: Value = _joint(1.0, "1", "controller's D times this", 0.0)
    dead_band: Value = _joint(0.0, "rad", "added to the half width of the controller's dead band", 0.0)
    command_delay: Value = _joint(0.0, "s", "q_d, dq_d and feed-forward arrive later", 0.0)
    command_cutoff: Value = _joint(
        _INF, "Hz", "first-order low-pass of q_d and dq_d, 1 - exp(-2 pi f h)", 0.0, True
    )
    # the torque's way to the drive, in this order
    effort_delay: Value = _joint(0.0, "s", "u arrives later", 0.0)
    hold_probability: Value = _joint(
        0.0, "1", "chance per period that the last u is kept; one draw an arm", 0.0
    )
    effort_cutoff: Value = _joint(_INF, "Hz", "first-order low-pass of u", 0.0, True)
    effort_rate_limit: Value = _joint(_INF, "N m/s", "most change of u", 0.0, True)
    effort_limit: Value = _joint(_INF, "N m", "u clipped at the drive", 0.0, True)
    actuator_gain: Value = _joint(0.0, "1", "drive torque = u (1 + gain)", -1.0)
    back_emf: Value = _joint(
        0.0, "N m s/rad", "added to what a motor's speed takes of its torque while powered"
    )
    torque_offset: Value = _joint(0.0, "N m", "drive torque += offset")
    harmonic_amplitude: Value = _joint(0.0, "N m", "drive torque += A sin(order q + phase)")
    harmonic_order: Value = _joint(1.0, "1/rev", "order of harmonic_amplitude")
    harmonic_phase: Value = _joint(0.0, "rad", "phase of harmonic_amplitude")
    rotor_inertia: Value = _joint(0.0, "kg m2", "added to the nominal armature")
    # friction, upstream of the torque sensor
    coulomb: Value = _joint(
        0.0, "N m", "L = nominal + coulomb + ...; friction = L tanh(dq / coulomb_velocity)"
    )
    coulomb_velocity: Value = _joint(0.005, "rad/s", "smoothing of the sign", 0.0, True)
    viscous: Value = _joint(0.0, "N m s/rad", "friction += (nominal + viscous) dq")
    stribeck_drop: Value = _joint(0.0, "N m", "L += drop exp(-|dq / stribeck_velocity|^stribeck_exponent)")
    stribeck_velocity: Value = _joint(0.1, "rad/s", "where stribeck_drop fades", 0.0, True)
    stribeck_exponent: Value = _joint(
        2.0, "1", "how steeply stribeck_drop fades; 0: drop / (1 + (dq / stribeck_velocity)^2)", 0.0
    )
    load_friction: Value = _joint(0.0, "1", "L += load_friction |tau|")
    friction_asymmetry: Value = _joint(0.0, "N m", "friction += asymmetry tanh^2(dq / coulomb_velocity)")
    friction_harmonic_amplitude: Value = _joint(0.0, "N m", "L += A sin(order q + phase)")
    friction_harmonic_order: Value = _joint(1.0, "1/rev", "order of friction_harmonic_amplitude")
    friction_harmonic_phase: Value = _joint(0.0, "rad", "phase of friction_harmonic_amplitude")
    presliding_stiffness: Value = _joint(
        0.0,
        "N m/rad",
        "s0 > 0: L acts through a bristle, dz/dt = dq - s0 |dq| z / L, friction s0 z (LuGre)",
        0.0,
    )
    thermal_ratio: Value = _joint(
        0.0, "1", "all friction times 1 + ratio exp(-(t + thermal_offset) / thermal_time)"
    )
    thermal_time: Value = _joint(600.0, "s", "time constant of thermal_ratio", 0.0, True)
    thermal_offset: Value = _joint(0.0, "s", "time that the arm had run before the recording")
    # transmission
    joint_stiffness: Value = _joint(_INF, "N m/rad", "tau = K (q_motor - q) + D (dq_motor - dq)", 0.0, True)
    joint_damping: Value = _joint(0.0, "N m s/rad", "D of joint_stiffness", 0.0)
    backlash: Value = _joint(
        0.0,
        "rad",
        "half width of a dead zone in joint_stiffness; a rigid joint gets 500 / rad x effort limit",
        0.0,
    )
    hysteresis_amplitude: Value = _joint(
        0.0, "rad", "reading += z, dz = (A sign(dtau) - z) |dtau| / hysteresis_torque (Dahl in torque)"
    )
    hysteresis_torque: Value = _joint(5.0, "N m", "torque over which z turns round", 0.0, True)
    # torque sensor
    sensor_gain: Value = _joint(0.0, "1", "reading = (1 + gain) tau + bias + drift t")
    sensor_bias: Value = _joint(0.0, "N m", "see sensor_gain")
    sensor_drift: Value = _joint(0.0, "N m/s", "see sensor_gain")
    # link side
    cable_stiffness: Value = _joint(0.0, "N m/rad", "link torque -= stiffness (q - cable_rest)")
    cable_rest: Value = _joint(0.0, "rad", "see cable_stiffness")
    cable_friction: Value = _joint(0.0, "N m", "link torque -= friction z, dz/dt = (dq - |dq| z) / 0.05 rad")
    # body
    # (J, 10) added to [m, m c, Ixx Ixy Iyy Ixz Iyz Izz] at each joint.
    inertial_delta: np.ndarray | None = None
    payload: np.ndarray | None = None  # (10,) the same ten about the flange, added there
    gravity: np.ndarray | None = None  # (3,) [m/s2] in the base frame; None is the controller's
    mount_stiffness: float = _INF  # [N m/rad] of the base about its x and y; infinity is rigid
    mount_damping: float = 0.0  # [N m s/rad]
    mount_inertia: float = 0.0  # [kg m2] that swings with the base
    # how it is read
    reading: str = "motor"  # side of the transmission on which the encoder sits: "motor" or "link"
    seed: int = 0  # of hold_probability's draws

    def __post_init__(self) -> None:
        for f in fields(self):
            if f.metadata.get("kind") == "joint":
                _check(f.name, getattr(self, f.name), f.metadata)
        for name, shape in (("inertial_delta", (-1, 10)), ("payload", (10,)), ("gravity", (3,))):
            value = getattr(self, name)
            if value is None:
                continue
            array = np.asarray(value, dtype=float)
            if array.ndim != len(shape) or array.shape[-1] != shape[-1] or not np.isfinite(array).all():
                size = "(J, 10)" if name == "inertial_delta" else str(shape)
                raise InputError(f"{name} has shape {array.shape}; it must be {size} and finite")
        if not self.mount_stiffness > 0 or not self.mount_damping >= 0 or not self.mount_inertia >= 0:
            raise InputError(
                f"mount stiffness {self.mount_stiffness} N m/rad must be positive, "
                f"damping {self.mount_damping} and inertia {self.mount_inertia} not negative"
            )
        if self.reading not in ("motor", "link"):
            raise InputError(f"reading is '{self.reading}'; it must be 'motor' or 'link'")

    def joint_values(self, name: str, joints: int) -> np.ndarray:
        """A joint field as (J,).

        Raises:
            InputError: the field has another number of joints.
        """
        value = getattr(self, name)
        if isinstance(value, float | int):
            return np.full(joints, float(value))
        value = np.asarray(value, dtype=float)
        if value.shape not in ((), (1,), (joints,)):
            raise InputError(
                f"{name} has shape {value.shape}; it must be one number or ({joints},), one per joint"
            )
        return np.broadcast_to(value, (joints,)).astype(float)


def joint_fields() -> dict[str, Mapping[str, Any]]:
    """Name to metadata (unit, text) of the fields that each joint has."""
    return {f.name: {**f.metadata, "default": f.default} for f in fields(PlantParameters) if f.metadata}


def _check(name: str, value: Value, metadata: Mapping[str, Any]) -> None:
    low, positive = metadata["low"], metadata["positive"]
    if isinstance(value, float | int):  # the usual case, a hundred times faster than through an array
        inside = value > low if positive else value >= low
        bad = not (inside and value > -_INF)
        endless = value == _INF
    else:
        array = np.asarray(value, dtype=float)
        inside = array > low if positive else array >= low
        bad = array.ndim > 1 or not inside.all() or bool(np.isneginf(array).any())
        endless = bool(np.isposinf(array).any())
    unit = metadata["unit"]
    if bad:
        bound = f"{'above' if positive else 'at least'} {low}" if low > -_INF else "finite"
        raise InputError(f"{name} is {value} {unit}; it must be one number or one per joint, {bound}")
    if endless and _DEFAULTS[name] != _INF:
        raise InputError(f"{name} is {value} {unit}; it must be finite")


_DEFAULTS = {f.name: f.default for f in fields(PlantParameters) if f.metadata}
