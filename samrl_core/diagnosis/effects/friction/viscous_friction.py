"""2: viscous friction."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.robots.joint_dynamics import joint_dynamics
from samrl_core.diagnosis.effects.drive_torque import BEYOND, DriveEffect, ShaftForm, are_possible, name_sizes
from samrl_core.diagnosis.effects.effect import Parameter
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.residuals.trial import Trial


class ViscousFriction(DriveEffect):
    """Friction in proportion to speed."""

    family, number, title = "viscous_friction", 2, "Viscous friction"
    meaning = "A torque that grows in proportion to joint speed brakes the motion."
    remedy = (
        "Set the joint's damping in the model to the fitted value; it depends on grease and temperature, so "
        "measure again warm."
    )
    formula = "tau_f = Fv dq"
    source = "ranges: Gaz et al. 2019; MuJoCo Menagerie panda.xml has damping 1"
    excitation = "several cruise speeds"
    curve_over = "velocity"
    confounded_with = ("coulomb_friction", "command_delay", "controller_gain")
    parameters = (Parameter("Fv", "N m s/rad", 0.05, 2.0, "friction per speed"),)
    at_every_joint = True

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        form = ProportionalToSpeed(place=place, amplitudes=("Fv",))
        return form.with_shafts(trial) if place.is_arm else (form,)


class ProportionalToSpeed(ShaftForm):
    """The speed itself."""

    def friction(self, trial: Trial, speed: np.ndarray, shape: Shape) -> np.ndarray:
        return speed

    def spread(self, trial: Trial, joint: int) -> float:
        speed = float(np.sqrt(np.mean(trial.motion.sure_velocity[:, joint] ** 2))) + 1e-9
        return 0.1 * trial.scale[joint] / max(speed, 0.05)

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        stated = joint_dynamics(trial.recording.arm).damping
        return are_possible(self.place, amplitudes, lambda j: _beyond_tolerance(trial, j), stated)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return name_sizes(trial, self.place, "Fv", amplitudes, self.shaft)

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        if self.shaft is not None:
            return None  # the simulated drives share no shaft
        return {"viscous": self.at_joints(trial, amplitudes)}


def _beyond_tolerance(trial: Trial, joint: int) -> float:
    tolerance = np.broadcast_to(trial.recording.arm.tolerances.viscous_friction, (trial.joints,))[joint]
    return BEYOND * float(tolerance) * trial.scale[joint] / float(trial.speed_scale[joint])


EFFECT = ViscousFriction()
