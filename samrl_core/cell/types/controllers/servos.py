"""Servos: a loop on position or speed, inside the drive, whose output is a torque or a voltage."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from samrl_core.cell.types.controllers.kind import ENCODER, ControllerKind, Gains, Key
from samrl_core.cell.types.controllers.motors import (
    MOTOR,
    ON_VOLTAGE,
    SOME_DRIVEN,
    back_emf,
    limit_of,
    rotor,
    torque_per_volt,
)
from samrl_core.cell.types.drive_law import DriveLaw


class PositionServo(ControllerKind):
    """A position loop whose output is a torque, by a current loop within."""

    name = "position_servo"
    title = "Position servo"
    formula = (
        "e = q_d - q; u = clip(K dz(e) + punch sgn(dz(e)) + Ki int dz(e) + D (s dq_d - dq) + feed-forward);"
        " torque u"
    )
    source = "ROBOTIS e-manual, MX-28: PID and feed-forward gains; AX-12: compliance margin and punch"
    keys = (
        Key("stiffness", "N m/rad", "K; 0 at a joint that nothing drives", None, True, True),
        Key("damping", "N m s/rad", "D", 0.0),
        Key("integral", "N m/(rad s)", "Ki; stands still while the output is clipped", 0.0),
        Key("velocity_feedforward", "1", "s, share of the commanded velocity", 0.0),
        Key("dead_band", "rad", "half width of the error that is ignored: dz(e)", 0.0),
        Key("punch", "N m", "torque that sets in beyond the dead band", 0.0),
    )
    choices = ENCODER

    def gains(self, values: Mapping[str, np.ndarray], words: Mapping[str, str]) -> Gains:
        """As the formula says."""
        law = DriveLaw(
            velocity_share=values["velocity_feedforward"],
            integral=values["integral"],
            dead_band=values["dead_band"],
            punch=values["punch"],
            encoder=words["encoder"],
        )
        return Gains(law, values["stiffness"], values["damping"])


class VoltageServo(ControllerKind):
    """A position loop whose output is the motor's voltage, or duty cycle: the servos of small robots."""

    name = "voltage_servo"
    title = "Position servo on a voltage"
    formula = (
        "V = clip(kp dz(e) + punch sgn(dz(e)) + ki int dz(e) + kd (s dq_d - dq));"
        " torque = kt N/R (V - ke N dq)"
    )
    source = (
        "ROBOTIS e-manual, position control of MX and X series: output is a PWM duty cycle; Feetech STS alike"
    )
    keys = (
        Key("proportional", "V/rad", "kp: duty per error times supply voltage", None, True),
        Key("derivative", "V s/rad", "kd", 0.0),
        Key("integral", "V/(rad s)", "ki; stands still while the output is clipped", 0.0),
        Key("velocity_feedforward", "1", "s, share of the commanded velocity", 0.0),
        Key("dead_band", "rad", "half width of the error that is ignored: dz(e)", 0.0),
        Key("punch", "V", "voltage that sets in beyond the dead band", 0.0),
        Key("voltage_limit", "V", "supply, or most duty times supply", None, True),
        SOME_DRIVEN,
        *MOTOR[1:],
    )
    choices = ON_VOLTAGE

    def gains(self, values: Mapping[str, np.ndarray], words: Mapping[str, str]) -> Gains:
        """As the formula says."""
        strength = torque_per_volt(values)
        law = DriveLaw(
            velocity_share=values["velocity_feedforward"],
            integral=strength * values["integral"],
            dead_band=values["dead_band"],
            punch=strength * values["punch"],
            back_emf=back_emf(values),
            braked=words["off"] == "braked",
            after_back_emf=words["effort_from"] == "current",
            encoder=words["encoder"],
            torque_per_volt=strength,
            torque_per_ampere=values["torque_constant"] * values["gear_ratio"],
            most_volt=values["voltage_limit"],
        )
        return Gains(
            law,
            strength * values["proportional"],
            strength * values["derivative"],
            limit_of(strength, values["voltage_limit"]),
            rotor(values),
        )


class VelocityDrive(ControllerKind):
    """A speed loop, with a position loop around it or none."""

    name = "velocity_drive"
    title = "Velocity drive"
    formula = "w = kp e + s dq_d - dq; u = clip(kv w + ki int w); torque u"
    source = "cascaded P-PI loops of servo drives; the EMPS benchmark of Janot, Gautier and Brunot 2019"
    keys = (
        Key("velocity_gain", "N m s/rad", "kv; 0 at a joint that nothing drives", None, True, True),
        Key("position_gain", "1/s", "kp; 0 is a speed loop alone", 0.0),
        Key("integral", "N m/rad", "ki; stands still while the output is clipped", 0.0),
        Key("velocity_feedforward", "1", "s, share of the commanded velocity", 1.0),
    )
    choices = ENCODER

    def gains(self, values: Mapping[str, np.ndarray], words: Mapping[str, str]) -> Gains:
        """As the formula says."""
        law = DriveLaw(
            velocity_share=values["velocity_feedforward"],
            integral=values["integral"] * values["position_gain"],
            velocity_integral=values["integral"],
            cascaded=True,
            encoder=words["encoder"],
        )
        return Gains(law, values["velocity_gain"] * values["position_gain"], values["velocity_gain"])
