"""Direct-current motors without a loop of their own: what was recorded of current or voltage drives them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from samrl_core.cell.types.controllers.kind import ENCODER, OFF, SIDES, ControllerKind, Gains, Key
from samrl_core.cell.types.drive_law import DriveLaw

EFFORT_FROM = ("voltage", "current")
MOTOR = (
    Key("torque_constant", "N m/A", "kt, at the motor", None, True),
    Key("back_emf_constant", "V s/rad", "ke, at the motor; kt where it is 0", 0.0),
    Key("resistance", "ohm", "R, from terminal to terminal", None, True),
    Key("gear_ratio", "1", "N, motor rad per joint rad (rad/m)", 1.0, True),
    Key("rotor_inertia", "kg m2", "at the motor; the joint feels N^2 of it", 0.0),
)
ON_VOLTAGE = {"encoder": SIDES, "off": OFF, "effort_from": EFFORT_FROM}


# A pendulum on a driven arm, a pole on a cart: a joint without a motor has a torque constant of 0.
SOME_DRIVEN = replace(MOTOR[0], meaning="kt, at the motor; 0 at a joint without one", absent=True)


def torque_per_volt(values: Mapping[str, np.ndarray]) -> np.ndarray:
    """kt N / R: torque at standstill; 0 where there is no motor."""
    strength = values["torque_constant"] * values["gear_ratio"]
    return np.divide(strength, values["resistance"], out=np.zeros_like(strength), where=strength > 0)


def limit_of(strength: np.ndarray, most: np.ndarray) -> np.ndarray | None:
    """Most torque (J,) at the most volts or amperes: none where any motor's is not stated.

    Infinite where there is no motor: nothing that acts there is limited.
    """
    driven = strength > 0
    if not np.all(most[driven] > 0):
        return None
    return np.where(driven, strength * most, np.inf)


def back_emf(values: Mapping[str, np.ndarray]) -> np.ndarray:
    """kt N / R ke N: torque lost per speed of the joint."""
    given = values["back_emf_constant"]
    constant = np.where(given > 0, given, values["torque_constant"])
    return torque_per_volt(values) * constant * values["gear_ratio"]


def rotor(values: Mapping[str, np.ndarray]) -> np.ndarray | None:
    """Rotor inertia at the joint; None where none is stated."""
    inertia = values["gear_ratio"] ** 2 * values["rotor_inertia"]
    return inertia if np.any(inertia > 0) else None


class VoltageMotor(ControllerKind):
    """A motor at a voltage, the input."""

    name = "voltage_motor"
    title = "Motor on a voltage"
    formula = "torque = kt N/R (V - ke N dq); V is the recorded input"
    source = "maxon, Formulae handbook: U = R I + kn^-1 n, M = kM I; inductance is left out"
    keys = (Key("voltage_limit", "V", "most voltage", 0.0), SOME_DRIVEN, *MOTOR[1:])
    choices = ON_VOLTAGE

    def gains(self, values: Mapping[str, np.ndarray], words: Mapping[str, str]) -> Gains:
        """As the formula says."""
        strength, most = torque_per_volt(values), values["voltage_limit"]
        # Driven by its recorded current, a motor does not feel its own voltage.
        by_current = words["effort_from"] == "current"
        return Gains(
            DriveLaw(
                back_emf=0.0 if by_current else back_emf(values),
                braked=words["off"] == "braked",
                open_loop=True,
                encoder=words["encoder"],
                torque_per_volt=strength,
                torque_per_ampere=values["torque_constant"] * values["gear_ratio"],
                most_volt=most,
            ),
            limit=limit_of(strength, most),
            rotor=rotor(values),
        )


class CurrentMotor(ControllerKind):
    """A motor at a current, the input."""

    name = "current_motor"
    title = "Motor on a current"
    formula = "torque = kt N i; i is the recorded input"
    source = "maxon, Formulae handbook: M = kM I"
    keys = (
        SOME_DRIVEN,
        Key("gear_ratio", "1", "N, motor rad per joint rad (rad/m)", 1.0, True),
        Key("rotor_inertia", "kg m2", "at the motor; the joint feels N^2 of it", 0.0),
        Key("current_limit", "A", "most current", 0.0),
    )
    choices = ENCODER

    def gains(self, values: Mapping[str, np.ndarray], words: Mapping[str, str]) -> Gains:
        """As the formula says."""
        strength, most = values["torque_constant"] * values["gear_ratio"], values["current_limit"]
        return Gains(
            DriveLaw(open_loop=True, encoder=words["encoder"], torque_per_ampere=strength),
            limit=limit_of(strength, most),
            rotor=rotor(values),
        )
