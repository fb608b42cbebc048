"""54: motor constant."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.drive_torque import DriveEffect
from samrl_core.diagnosis.effects.effect import Parameter
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial, add


class MotorConstant(DriveEffect):
    """Torque per ampere and volts per speed are one number; both are off by the same factor."""

    family, number, title = "motor_constant", 54, "Motor constant"
    meaning = (
        "The motor gives another torque per ampere, and as much another back-EMF: its magnets are weaker."
    )
    remedy = (
        "Measure the no-load speed, which weak magnets raise, and scale the torque constant and the back-EMF "
        "constant of the model alike; a motor that has run hot is weaker until it has cooled."
    )
    formula = "tau = (1 + e) u - (1 + e)^2 b dq, b dq the loss to back-EMF"
    source = "IEC 60404-8-1: the remanence of ferrite falls by 0.2 %/K, of neodymium by 0.1 %/K"
    excitation = "stalls or reversals, and fast cruises"
    experiment = "two_loads"
    confounded_with = ("actuator_gain", "viscous_friction")
    parameters = (Parameter("e", "1", -0.3, 0.3, "relative error of both constants"),)

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        """None at joints whose description has no back-EMF: there it is a gain of the torque."""
        if not np.any(trial.motion.back_emf_loss[:, list(place.joints)]):
            return ()
        return (ScaledFlux(place=place, amplitudes=("a",)),)


class ScaledFlux(Form):
    """The amplitude a = e / (1 + e) is that of the torque which a motor must have delivered, tau.

    What was sent is u = tau / (1 + e) + (1 + e) b dq, so that u - b dq - tau = -a tau + e b dq. Both parts
    take the amplitude a, and the size is what the whole of them comes nearest to (`parameters`).
    """

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        return add(*self._parts(trial))

    def _parts(self, trial: Trial) -> tuple[Columns, Columns]:
        """What comes of the torque that was delivered while powered, by the model, and of back-EMF.

        Of speeds without their noise, which the stated back-EMF of what was read has put into the residual.
        """
        joint, motion, controller = self.joint, trial.motion, trial.recording.arm.controller
        assert controller is not None
        law, powered = controller.law, motion.enabled[:, joint]
        delivered = powered * trial.delivered_torque[:, joint]
        loss = law.of_joints("back_emf", trial.joints)[joint] * motion.sure_velocity[:, joint]
        lost = (loss if law.braked else powered * loss)[None]
        # Where the current is recorded, back-EMF shows in what the law makes of it.
        put = trial.controller if law.after_back_emf and not motion.computed else trial.drive
        return trial.drive(joint, -delivered[None]), put(joint, lost)

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        """Centred on no effect."""
        return np.zeros(1), np.array([0.15])

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(abs(amplitudes[0]) < 0.35)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        """To second order: a^2 times the torque's share of all that is seen is what a lacks of e."""
        key = ("motor constant", self.place.name)
        if key not in trial.cached:
            delivered, _ = parts = self._parts(trial)
            whole = add(*parts)
            seen = {k: rows / trial.sigma[k[0]][:, k[1]] ** 2 for k, rows in whole.items()}
            most = sum(float(np.sum(rows * seen[k])) for k, rows in whole.items())
            trial.cached[key] = sum(float(np.sum(rows * seen[k])) for k, rows in delivered.items()) / most
        a, share = float(amplitudes[0]), trial.cached[key]
        return {"e": a / (1.0 - share * a)}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        controller = trial.recording.arm.controller
        assert controller is not None
        error = self.parameters(trial, shape, amplitudes)["e"]
        loss = controller.law.of_joints("back_emf", trial.joints)[self.joint]
        return {
            "actuator_gain": self.at_joints(trial, error),
            "back_emf": self.at_joints(trial, ((1.0 + error) ** 2 - 1.0) * loss),
        }


EFFECT = MotorConstant()
