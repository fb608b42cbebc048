"""The library of effects: one file each, and the list that makes them known."""

from __future__ import annotations

from samrl_core.diagnosis.effects.actuator_gain import ActuatorGain
from samrl_core.diagnosis.effects.backlash import Backlash
from samrl_core.diagnosis.effects.base_tilt import BaseTilt
from samrl_core.diagnosis.effects.cable import Cable
from samrl_core.diagnosis.effects.command_delay import CommandDelay
from samrl_core.diagnosis.effects.command_low_pass import CommandLowPass
from samrl_core.diagnosis.effects.controller_gain import ControllerGain
from samrl_core.diagnosis.effects.coulomb_friction import CoulombFriction
from samrl_core.diagnosis.effects.effect import Effect
from samrl_core.diagnosis.effects.encoder_eccentricity import EncoderEccentricity
from samrl_core.diagnosis.effects.encoder_offset import EncoderOffset
from samrl_core.diagnosis.effects.friction_asymmetry import FrictionAsymmetry
from samrl_core.diagnosis.effects.gear_ripple import GearRipple
from samrl_core.diagnosis.effects.joint_elasticity import JointElasticity
from samrl_core.diagnosis.effects.link_inertia import LinkInertia
from samrl_core.diagnosis.effects.load_dependent_friction import LoadDependentFriction
from samrl_core.diagnosis.effects.mount_compliance import MountCompliance
from samrl_core.diagnosis.effects.packet_jitter import PacketJitter
from samrl_core.diagnosis.effects.payload import Payload
from samrl_core.diagnosis.effects.position_dependent_friction import PositionDependentFriction
from samrl_core.diagnosis.effects.presliding import Presliding
from samrl_core.diagnosis.effects.reflected_inertia import ReflectedInertia
from samrl_core.diagnosis.effects.stribeck_friction import StribeckFriction
from samrl_core.diagnosis.effects.thermal_friction import ThermalFriction
from samrl_core.diagnosis.effects.torque_rate_limit import TorqueRateLimit
from samrl_core.diagnosis.effects.torque_saturation import TorqueSaturation
from samrl_core.diagnosis.effects.torque_sensor_error import TorqueSensorError
from samrl_core.diagnosis.effects.transmission_hysteresis import TransmissionHysteresis
from samrl_core.diagnosis.effects.viscous_friction import ViscousFriction

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
