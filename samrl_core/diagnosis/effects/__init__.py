"""The library of effects: one file each, and the list that makes them known."""

from __future__ import annotations

from samrl_core.diagnosis.effects.drive.actuator_gain import ActuatorGain
from samrl_core.diagnosis.effects.drive.command_delay import CommandDelay
from samrl_core.diagnosis.effects.drive.command_low_pass import CommandLowPass
from samrl_core.diagnosis.effects.drive.controller_gain import ControllerGain
from samrl_core.diagnosis.effects.drive.packet_jitter import PacketJitter
from samrl_core.diagnosis.effects.drive.reflected_inertia import ReflectedInertia
from samrl_core.diagnosis.effects.drive.torque_rate_limit import TorqueRateLimit
from samrl_core.diagnosis.effects.drive.torque_saturation import TorqueSaturation
from samrl_core.diagnosis.effects.effect import Effect
from samrl_core.diagnosis.effects.friction.coulomb_friction import CoulombFriction
from samrl_core.diagnosis.effects.friction.friction_asymmetry import FrictionAsymmetry
from samrl_core.diagnosis.effects.friction.load_dependent_friction import LoadDependentFriction
from samrl_core.diagnosis.effects.friction.position_dependent_friction import PositionDependentFriction
from samrl_core.diagnosis.effects.friction.presliding import Presliding
from samrl_core.diagnosis.effects.friction.stribeck_friction import StribeckFriction
from samrl_core.diagnosis.effects.friction.thermal_friction import ThermalFriction
from samrl_core.diagnosis.effects.friction.viscous_friction import ViscousFriction
from samrl_core.diagnosis.effects.load.base_tilt import BaseTilt
from samrl_core.diagnosis.effects.load.cable import Cable
from samrl_core.diagnosis.effects.load.link_inertia import LinkInertia
from samrl_core.diagnosis.effects.load.mount_compliance import MountCompliance
from samrl_core.diagnosis.effects.load.payload import Payload
from samrl_core.diagnosis.effects.sensor.encoder_eccentricity import EncoderEccentricity
from samrl_core.diagnosis.effects.sensor.encoder_offset import EncoderOffset
from samrl_core.diagnosis.effects.sensor.torque_sensor_error import TorqueSensorError
from samrl_core.diagnosis.effects.transmission.backlash import Backlash
from samrl_core.diagnosis.effects.transmission.gear_ripple import GearRipple
from samrl_core.diagnosis.effects.transmission.joint_elasticity import JointElasticity
from samrl_core.diagnosis.effects.transmission.transmission_hysteresis import TransmissionHysteresis

EFFECTS: tuple[Effect, ...] = (
    CoulombFriction(),
    ViscousFriction(),
    StribeckFriction(),
    LoadDependentFriction(),
    Presliding(),
    FrictionAsymmetry(),
    PositionDependentFriction(),
    GearRipple(),
    ThermalFriction(),
    Backlash(),
    JointElasticity(),
    TransmissionHysteresis(),
    ReflectedInertia(),
    ActuatorGain(),
    TorqueSaturation(),
    TorqueRateLimit(),
    CommandLowPass(),
    CommandDelay(),
    PacketJitter(),
    ControllerGain(),
    EncoderOffset(),
    EncoderEccentricity(),
    TorqueSensorError(),
    Payload(),
    LinkInertia(),
    BaseTilt(),
    MountCompliance(),
    Cable(),
)

# Families of the contract that joint channels cannot show, and why.
NOT_BY_JOINTS: dict[str, str] = {
    "kinematic_error": "a wrong length leaves joint channels as they are; needs an external pose (camera)",
    "base_to_base": "needs both arms to see one another (camera)",
}

__all__ = ["EFFECTS", "NOT_BY_JOINTS", "Effect"]
