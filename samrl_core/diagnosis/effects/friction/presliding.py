"""5: presliding."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from samrl_core.diagnosis.effects.drive_torque import DriveEffect, DriveForm, least_bend
from samrl_core.diagnosis.effects.effect import Parameter
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.residuals.basis_functions import bristle, play, travel
from samrl_core.diagnosis.residuals.motion import RecordedMotion
from samrl_core.diagnosis.residuals.trial import Trial

LONGEST = 0.03  # [rad] over which a friction builds up
YIELDS = (0.25, 0.75, 1.25, 1.75)  # of xs: springs of equal strength that yield at evenly spread twists


class Presliding(DriveEffect):
    """Friction that builds up over a small displacement, like a spring, before it slides."""

    family, number, title = "presliding", 5, "Presliding friction"
    meaning = (
        "Before it slides, the contact bends like a stiff lossy spring, so tiny moves show hysteresis loops."
    )
    remedy = (
        "Use a friction model with a bristle state (LuGre, Dahl) if millirad accuracy or contact matters."
    )
    formula = "dz/dt = dq - |dq| z / xs, tau_f = Fc z / xs, or springs that yield one after another"
    source = (
        "Dahl 1968; Canudas de Wit et al. 1995 (LuGre); generalised Maxwell slip: Iwan 1966, "
        "Al-Bender, Lampaert and Swevers 2005"
    )
    excitation = "reversals of milliradians"
    experiment = "micro_reversals"
    curve_over = "velocity"
    renamed_shapes = ("xs",)
    confounded_with = ("coulomb_friction", "joint_elasticity", "transmission_hysteresis", "backlash")
    contains = ("coulomb_friction",)
    parameters = (
        Parameter("Fc", "N m", 0.05, 1.5, "level when sliding"),
        Parameter("sigma0", "N m/rad", 50.0, 10000.0, "stiffness of the contact, Fc / xs"),
    )

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        least = least_bend(trial, place.joints)  # below it, it is Coulomb's stiff bristle
        if 1.5 * least >= LONGEST:
            return ()
        limits = {"xs": (least, LONGEST)}
        soft, softer = (
            tuple({"xs": x} for x in grid if least < x) or ({"xs": 1.5 * least},)
            for grid in ((2e-4, 6e-4, 2e-3, 6e-3), (1e-3, 6e-3))
        )
        return (
            DahlBristle(place=place, amplitudes=("Fc",), shapes=soft, refine=limits),
            MaxwellSlip(
                name="Maxwell slip",
                place=place,
                amplitudes=("Fc",),
                shapes=softer,
                refine=limits,
            ),
        )


class BuildingUp(DriveForm):
    """A friction that builds up over a distance `xs`."""

    @abstractmethod
    def build_up(self, motion: RecordedMotion, joint: int, distance: float) -> np.ndarray:
        """Friction (F,) of unit level."""

    def torque(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        return self.build_up(trial.motion, joint, shape["xs"])[None]

    def spread(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        return np.array([0.1 * trial.scale[joint]])

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(amplitudes[0] > 0)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {"Fc": float(amplitudes[0]), "sigma0": float(amplitudes[0]) / shape["xs"]}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        return {
            "coulomb": self.at_joints(trial, amplitudes[0]),
            "presliding_stiffness": self.at_joints(trial, amplitudes[0] / shape["xs"]),
        }


class DahlBristle(BuildingUp):
    """One bristle."""

    def build_up(self, motion: RecordedMotion, joint: int, distance: float) -> np.ndarray:
        return bristle(travel(motion.sure_velocity[:, joint], motion.rate), distance)


class MaxwellSlip(BuildingUp):
    """Springs that yield one after another."""

    def build_up(self, motion: RecordedMotion, joint: int, distance: float) -> np.ndarray:
        q = np.interp(motion.t, motion.time, travel(motion.sure_velocity[:, joint], motion.rate))
        # The mean of the yields is the distance by which Dahl's bristle turns over, too.
        parts = [(q - play(q, share * distance)) / (share * distance) for share in YIELDS]
        return np.interp(motion.time, motion.t, np.mean(parts, axis=0))


EFFECT = Presliding()
