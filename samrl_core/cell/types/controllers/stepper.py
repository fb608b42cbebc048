"""Steppers: no loop, but a magnetic spring that repeats every four full steps."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from samrl_core.cell.types.controllers.kind import ENCODER, ControllerKind, Gains, Key
from samrl_core.cell.types.controllers.motors import rotor
from samrl_core.cell.types.drive_law import DriveLaw

STEPS_PER_PERIOD = 4.0  # full steps of a two-phase motor to one period of its torque


class Stepper(ControllerKind):
    """A two-phase stepper on microsteps."""

    name = "stepper"
    title = "Stepper"
    formula = "torque = Th N sin(p (q_step - q)) - D dq; q_step = q_d in microsteps; p = full_steps/4 x N"
    source = "Acarnley 2002, Stepping Motors, static torque/position characteristic"
    keys = (
        Key("holding_torque", "N m", "Th, at the motor", None, True),
        Key("full_steps", "1", "per turn of the motor", 200.0, True),
        Key("microsteps", "1", "per full step", 16.0, True),
        Key("gear_ratio", "1", "N, motor rad per joint rad (rad/m)", 1.0, True),
        Key("damping", "N m s/rad", "D, at the joint", 0.0),
        Key("rotor_inertia", "kg m2", "at the motor; the joint feels N^2 of it", 0.0),
    )
    choices = ENCODER

    def gains(self, values: Mapping[str, np.ndarray], words: Mapping[str, str]) -> Gains:
        """As the formula says."""
        most = values["holding_torque"] * values["gear_ratio"]
        pitch = values["full_steps"] / STEPS_PER_PERIOD * values["gear_ratio"]
        step = 2.0 * np.pi / (values["full_steps"] * values["microsteps"] * values["gear_ratio"])
        law = DriveLaw(velocity_share=0.0, command_step=step, pole_pitch=pitch, encoder=words["encoder"])
        return Gains(law, most * pitch, values["damping"], most, rotor(values))
