"""One known size of every effect: as fields of the simulator and as shape and amplitudes of the regressors.

Both sides are written by hand from the documented meaning of their parameters, so that a test may compare
the two implementations; neither side is derived from the other.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from samrl_core.diagnosis.effects import Effect
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.residuals.trial import Trial
from tests.diagnosis.worlds import BEND, LIFT, TURN

GRAVITY = np.array([0.0, 0.0, -9.81])
# ten inertial parameters of a box of 0.6 kg at (0.05, 0.02, 0.04) m from the flange, about the flange
PAYLOAD = np.array([0.6, 0.03, 0.012, 0.024, 1.8e-3, -6e-4, 2.9e-3, -1.2e-3, -4.8e-4, 2.2e-3])
# the fore-arm's own frame is the flange's here, as its link is the last of the chain
UPPER = np.array([0.5, 0.1, 0.01, 0.0, 1e-3, -2e-3, 0.025, 0.0, 0.0, 0.026])
# three tenths of all that the fore-arm has
FORE = np.array([0.39, 0.0546, 0.0, 0.0039, 6.39e-4, 0.0, 0.010383, -5.46e-4, 0.0, 0.010344])

# the fore-arm's centre of mass 15 mm farther out and 8 mm aside, exactly: its mass is 1.3 kg
SHIFT = np.array([0.015, -0.008, 0.0])


def shifted_fore(shift: np.ndarray = SHIFT) -> np.ndarray:
    """Change of the fore-arm's inertial parameters (10,) by a shift of its centre of mass (3,) [m]."""
    mass, centre = 1.3, np.array([0.14, 0.0, 0.01])
    after, before = (c @ c * np.eye(3) - np.outer(c, c) for c in (centre + shift, centre))
    inertia = mass * (after - before)
    return np.concatenate([[0.0], mass * shift, inertia[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]])


def find_form(effect: Effect, trial: Trial, place: str, name: str) -> Form:
    """The form of that name at a place of the contract."""
    (form,) = (f for f in effect.forms(trial, Place.find(trial, place)) if f.name == name)
    return form


@dataclass(frozen=True)
class Case:
    """`fields` as for worlds.plant; `physical` are the parameters that must come out of a fit."""

    family: str
    place: str
    form: str
    fields: dict[str, Any]
    shape: dict[str, float]
    amplitudes: tuple[float, ...]
    physical: dict[str, float] = field(default_factory=dict)
    programmes: str = "A"
    explained: float = 0.9  # share of the residual's energy that the true amplitudes must take away
    within: float = 0.15  # relative error of a parameter

    @property
    def name(self) -> str:
        return f"{self.family}-{self.form}".strip("-").replace(" ", "_")


def harmonic(amplitude: float, phase: float, sign: float = 1.0) -> tuple[float, float]:
    """A sin(x + phase) as factors of sine and cosine."""
    return sign * amplitude * np.cos(phase), sign * amplitude * np.sin(phase)


TILTED = Rotation.from_rotvec([0.03, -0.02, 0.0]).inv().apply(GRAVITY)  # gravity seen from a tilted base
SIGN = {"v": 0.005}

CASES: tuple[Case, ...] = (
    Case("coulomb_friction", "joint:lift", "smooth", {"coulomb": {LIFT: 0.8}}, SIGN, (0.8,), {"Fc": 0.8}),
    # the simulator's tanh lies at an exponent of 2.8
    Case(
        "coulomb_friction", "joint:lift", "slow to saturate", {"coulomb": {LIFT: 0.8}},
        {"v": 0.0054, "p": 2.8}, (0.8,), {"Fc": 0.8},
    ),
    Case(
        "coulomb_friction", "joint:lift", "stiff bristle",
        {"coulomb": {LIFT: 0.8}, "presliding_stiffness": {LIFT: 8000.0}}, {"xs": 1e-4}, (0.8,), {"Fc": 0.8},
        "ABC",
    ),
    Case("viscous_friction", "joint:lift", "", {"viscous": {LIFT: 0.8}}, {}, (0.8,), {"Fv": 0.8}),
    Case(
        "stribeck_friction", "joint:turn", "exponential",
        {"coulomb": {TURN: 0.4}, "stribeck_drop": {TURN: 0.5}, "stribeck_velocity": {TURN: 0.1}},
        {"v": 0.005, "vs": 0.1, "d": 2.0}, (0.4, 0.5), {"Fc": 0.4, "drop": 0.5, "vs": 0.1},
    ),
    Case(
        "load_dependent_friction", "joint:lift", "", {"load_friction": {LIFT: 0.1}}, SIGN, (0.1,), {"Kl": 0.1}
    ),
    Case(
        "load_dependent_friction", "joint:lift", "directional", {"load_friction": {LIFT: 0.1}}, SIGN,
        (0.1, 0.1), {"Kl": 0.1, "Kb": 0.1},
    ),
    Case(
        "presliding", "joint:lift", "", {"coulomb": {LIFT: 0.8}, "presliding_stiffness": {LIFT: 400.0}},
        {"xs": 0.002}, (0.8,), {"Fc": 0.8, "sigma0": 400.0},
    ),
    # springs that yield in turn are not the simulator's bristle, but near to it
    Case(
        "presliding", "joint:lift", "Maxwell slip",
        {"coulomb": {LIFT: 0.8}, "presliding_stiffness": {LIFT: 400.0}}, {"xs": 0.002}, (0.8,), {"Fc": 0.8},
        explained=0.8,
    ),
    Case(
        "friction_asymmetry", "joint:lift", "levels",
        {"coulomb": {LIFT: 0.5}, "friction_asymmetry": {LIFT: 0.4}}, SIGN, (0.5, 0.4),
        {"mean": 0.5, "difference": 0.4},
    ),
    Case(
        "position_dependent_friction", "joint:turn", "friction",
        {"friction_harmonic_amplitude": {TURN: 0.5}, "friction_harmonic_order": {TURN: 4.0},
         "friction_harmonic_phase": {TURN: 0.6}},
        {"k": 4.0}, harmonic(0.5, 0.6), {"amplitude": 0.5, "order": 4.0, "phase": 0.6},
    ),
    Case(
        "position_dependent_friction", "joint:turn", "friction everywhere",
        {"coulomb": {TURN: 0.6}, "friction_harmonic_amplitude": {TURN: 0.4},
         "friction_harmonic_order": {TURN: 4.0}, "friction_harmonic_phase": {TURN: 0.6}},
        {"k": 4.0}, (0.6, *harmonic(0.4, 0.6), 0.0, 0.0),
        {"level": 0.6, "amplitude": 0.4, "order": 4.0, "phase": 0.6},
    ),
    # a torque that the drive gets on top is one that is not lost: the formula counts what is lost
    Case(
        "position_dependent_friction", "joint:turn", "torque",
        {"harmonic_amplitude": {TURN: 0.5}, "harmonic_order": {TURN: 4.0}, "harmonic_phase": {TURN: 0.6}},
        {"k": 4.0}, harmonic(0.5, 0.6, -1.0), {"amplitude": 0.5, "order": 4.0, "phase": 0.6 - np.pi},
    ),
    Case(
        "gear_ripple", "joint:turn", "",
        {"harmonic_amplitude": {TURN: 0.3}, "harmonic_order": {TURN: 30.0}, "harmonic_phase": {TURN: 1.0}},
        {"N": 30.0}, harmonic(0.3, 1.0, -1.0), {"amplitude": 0.3, "order": 30.0, "phase": 1.0 - np.pi},
    ),
    Case(
        "gear_ripple", "joint:turn", "two lines",
        {"harmonic_amplitude": {TURN: 0.3}, "harmonic_order": {TURN: 30.0}, "harmonic_phase": {TURN: 1.0}},
        {"N": 30.0}, (*harmonic(0.3, 1.0, -1.0), 0.0, 0.0), {"amplitude": 0.3, "phase": 1.0 - np.pi},
    ),
    Case(
        "thermal_friction", "joint:lift", "each recording",
        {"coulomb": {LIFT: 0.4}, "thermal_ratio": {LIFT: 1.5}, "thermal_time": {LIFT: 3.0}},
        {"T": 3.0}, (0.4, 0.6), {"Finf": 0.4, "F0": 1.0}, "A",
    ),
    Case(
        "backlash", "joint:bend", "free",
        {"backlash": {BEND: 0.003}, "joint_stiffness": {BEND: 6000.0}, "joint_damping": {BEND: 12.0}},
        {"b": 0.003, "K": 6000.0, "d": 12.0}, (1.0,), {"b": 0.003}, "AB", explained=0.5, within=0.3,
    ),
    Case(
        "joint_elasticity", "joint:lift", "static", {"joint_stiffness": {LIFT: 3000.0}}, {}, (1 / 3000.0,),
        {"K": 3000.0}, "B", explained=0.8,
    ),
    Case(
        "joint_elasticity", "joint:lift", "swinging",
        {"joint_stiffness": {LIFT: 1500.0}, "joint_damping": {LIFT: 3.0}}, {"K": 1500.0, "d": 3.0}, (1.0,),
        {"K": 1500.0}, "B", explained=0.8,
    ),
    Case(
        "transmission_hysteresis", "joint:lift", "",
        {"hysteresis_amplitude": {LIFT: 0.002}, "hysteresis_torque": {LIFT: 6.0}}, {"ts": 6.0}, (0.002,),
        {"a": 0.002},
    ),
    Case("reflected_inertia", "joint:lift", "", {"rotor_inertia": {LIFT: 0.15}}, {}, (0.15,), {"Ja": 0.15}),
    Case("actuator_gain", "joint:lift", "", {"actuator_gain": {LIFT: 0.1}}, {}, (0.1,), {"e": 0.1}),
    Case("torque_offset", "joint:lift", "", {"torque_offset": {LIFT: 0.8}}, {}, (0.8,), {"b": 0.8}),
    Case(
        "torque_saturation", "joint:lift", "drive", {"effort_limit": {LIFT: 10.5}}, {"L": 10.5}, (1.0,),
        {"L": 10.5}, "B",
    ),
    Case(
        "torque_rate_limit", "joint:turn", "", {"effort_rate_limit": {TURN: 60.0}}, {"R": 60.0}, (1.0,),
        {"R": 60.0}, "B",
    ),
    Case(
        "command_low_pass", "joint:lift", "command", {"command_cutoff": {LIFT: 12.0}}, {"fc": 12.0}, (1.0,),
        {"fc": 12.0},
    ),
    Case(
        "command_low_pass", "arm:tool_arm", "effort", {"effort_cutoff": 25.0}, {"fc": 25.0}, (1.0,),
        {"fc": 25.0},
    ),
    Case(
        "dead_band", "joint:lift", "", {"dead_band": {LIFT: 0.001}}, {"width": 0.001}, (1.0,),
        {"width": 0.001},
    ),
    Case("command_delay", "joint:lift", "command", {"command_delay": {LIFT: 0.0065}}, {"T": 0.0065}, (1.0,),
         {"T": 0.0065}),
    Case("command_delay", "arm:tool_arm", "effort", {"effort_delay": 0.004}, {"T": 0.004}, (1.0,),
         {"T": 0.004}),
    Case("packet_jitter", "arm:tool_arm", "effort", {"hold_probability": 0.1}, {}, (1.0,),
         {"held": 0.1}, "D"),
    Case(
        "controller_gain", "joint:lift", "gains",
        {"stiffness_scale": {LIFT: 0.8}, "damping_scale": {LIFT: 1.2}}, {}, (-0.2, 0.2),
        {"eK": -0.2, "eD": 0.2},
    ),
    Case("encoder_offset", "joint:lift", "", {"encoder_offset": {LIFT: 0.03}}, {}, (0.03,), {"e": 0.03}),
    Case(
        "encoder_eccentricity", "joint:lift", "",
        {"encoder_amplitude": {LIFT: 0.016}, "encoder_phase": {LIFT: 0.5}}, {"k": 1.0}, harmonic(0.016, 0.5),
    ),
    Case(
        "torque_sensor_error", "joint:lift", "gain and bias",
        {"sensor_gain": {LIFT: 0.08}, "sensor_bias": {LIFT: 0.8}}, {}, (0.08, 0.8), {"g": 0.08, "b": 0.8},
    ),
    Case(
        "torque_sensor_error", "joint:bend", "drift",
        {"sensor_bias": {BEND: 0.3}, "sensor_drift": {BEND: 0.05}}, {}, (0.3, 0.05), {"d": 0.05}, "A",
    ),
    Case("payload", "arm:tool_arm", "", {"payload": PAYLOAD}, {}, tuple(PAYLOAD),
         {"mass": 0.6, "com_x": 0.05}),
    Case(
        "link_inertia", "link:upper", "", {"inertial_delta": np.stack([0 * UPPER, UPPER, 0 * UPPER])}, {},
        tuple(UPPER),
    ),
    Case(
        "link_inertia", "link:fore", "scale", {"inertial_delta": np.stack([0 * FORE, 0 * FORE, FORE])}, {},
        (0.3,), {"mass_error": 0.3, "mass": 0.39},
    ),
    Case(
        "link_inertia", "link:fore", "centre of mass",
        {"inertial_delta": np.stack([0 * FORE, 0 * FORE, shifted_fore()])}, {}, tuple(SHIFT),
        {"com_shift": 0.017, "first_moment": 1.3 * 0.017},
    ),
    Case(
        "base_tilt", "arm:tool_arm", "", {"gravity": TILTED}, {}, (0.03, -0.02),
        {"ax": 0.03, "ay": -0.02},
    ),
    Case(
        "mount_compliance", "arm:tool_arm", "rotation",
        {"mount_stiffness": 8000.0, "mount_damping": 40.0, "mount_inertia": 15.0}, {"f": 3.63, "z": 0.049},
        (1 / 8000.0, 1 / 8000.0), {"compliance": 1 / 8000.0}, "AB",
        explained=0.6, within=0.3,
    ),
    Case(
        "cable", "joint:bend", "",
        {"cable_stiffness": {BEND: 1.5}, "cable_rest": {BEND: 0.3}, "cable_friction": {BEND: 0.0}}, {},
        (1.5, 0.45, 0.0), {"k": 1.5, "q0": 0.3},
    ),
)  # fmt: skip
